# Start the server from this checkout on Windows; the first start installs it into .venv. Arguments are the server's.
# Where scripts are not allowed: powershell -ExecutionPolicy Bypass -File scripts\serve.ps1
$ErrorActionPreference = 'Stop'
$root = Split-Path -Parent $PSScriptRoot
$venv = Join-Path $root '.venv'
$python = Join-Path $venv 'Scripts\python.exe'
$server = Join-Path $venv 'Scripts\rosbridge-sim.exe'
$stamp = Join-Path $venv 'installed'

function Say([string] $text) { [Console]::Error.WriteLine("serve: $text") }

# Find-Python: the first Python that is new enough, as a command with its first arguments.
function Find-Python {
    $old = ''
    $candidates = @(@('py', '-3.14'), @('py', '-3.13'), @('py', '-3.12'), @('py', '-3.11'), @('py', '-3'), @('python'), @('python3'))
    if ($env:PYTHON) { $candidates = , @($env:PYTHON) }
    foreach ($candidate in $candidates) {
        $words = @($candidate)
        $command = $words[0]
        $first = @($words | Select-Object -Skip 1)
        if (-not (Get-Command $command -ErrorAction SilentlyContinue)) { continue }
        try { & $command @first -c 'import sys; sys.exit(0 if sys.version_info >= (3, 11) else 3)' 2>$null } catch { continue }
        if ($LASTEXITCODE -eq 0) { return , $words }
        if ($LASTEXITCODE -eq 3) { $old = "; $($words -join ' ') is older" }
    }
    Say "needs Python 3.11 or newer$old; install it from python.org, or name it: `$env:PYTHON = 'C:\path\to\python.exe'"
    exit 1
}

# pyproject.toml at the last installation, and its folder; another folder or another text starts a new installation.
$wanted = $root + "`n" + [IO.File]::ReadAllText((Join-Path $root 'pyproject.toml'))
$isCurrent = (Test-Path $server) -and (Test-Path $stamp) -and ([IO.File]::ReadAllText($stamp) -ceq $wanted)
if (-not $isCurrent) {
    if (-not (Test-Path $python)) {
        $words = Find-Python
        $first = @($words | Select-Object -Skip 1)
        Say 'making .venv'
        & $words[0] @first -m venv $venv
        if ($LASTEXITCODE -ne 0) { exit 1 }
    }
    Say 'installing into .venv (once; later starts skip this)'
    & $python -m pip install --quiet --disable-pip-version-check --editable $root
    if ($LASTEXITCODE -ne 0) {
        Say 'the installation failed; see the output of pip above'
        exit 1
    }
    [IO.File]::WriteAllText($stamp, $wanted)
}
& $server serve @args
exit $LASTEXITCODE
