# Sourced by `scripts/test`: programs that run beside the tests, one after another, each with its output in a file.
# shellcheck shell=bash

# start_beside COMMAND...: begin to run the commands. Each is one word, which is split at its spaces.
start_beside() {
    logs=$(mktemp -d)
    (
        # By the list of jobs: the signal may come before a variable has the number of one that has just begun.
        trap 'kill $(jobs -p) 2>/dev/null || true; wait; exit' TERM
        for command; do
            log=$logs/${command//[^a-zA-Z0-9.]/_}
            $command >"$log" 2>&1 &
            if wait $!; then
                printf '== passed: %s\n%s\n' "$command" "$(<"$log")"
            else
                printf '== failed: %s\n' "$command"
                printf '%s' "$command" >"$log.failed"
            fi
        done
    ) &
    beside=$!
    trap end_beside EXIT
}

# end_beside: end what still runs, as after Ctrl-C.
end_beside() {
    kill "$beside" 2>/dev/null && wait "$beside" || true
    rm -rf "$logs"
}

# wait_beside: wait for the commands, and print the last lines of those that failed; their names go into $failed.
wait_beside() {
    local name
    wait "$beside" || true
    for name in "$logs"/*.failed; do
        [[ -f $name ]] || continue
        failed+=("$(<"$name")")
        printf '\n== the last lines of %s\n%s\n' "$(<"$name")" "$(tail -n 60 "${name%.failed}")"
    done
}
