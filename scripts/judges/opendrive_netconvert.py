"""Compare lane movements and lane lengths of OpenDRIVE maps with those of SUMO's netconvert.

    scripts/judges/opendrive_netconvert.py FOLDER_OF_SUMO FILE.xodr...

FOLDER_OF_SUMO is that of the wheel `eclipse-sumo`, with bin/netconvert. Prints for each file the movements (pairs of
lanes outside of junctions, from one road to another) and the length of the lanes outside of junctions, of both. They
agree where each road has one section of lanes; elsewhere netconvert splits roads and guesses connections.
"""

from __future__ import annotations

import os
import subprocess
import sys
import tempfile
from pathlib import Path
from xml.etree import ElementTree as ET

from rosbridge_sim.maps.opendrive.opendrive_map import read_opendrive


def measure(path: Path) -> tuple[int, float, int]:
    """Return the movements, the length of lanes outside of junctions [km], and the largest number of sections."""
    road_map = read_opendrive([path.read_bytes()], str(path))
    roads, positions = road_map.roads, road_map.positions
    assert positions is not None
    inside = {one.get("id") for one in ET.parse(path).getroot().iter("road") if one.get("junction", "-1") != "-1"}  # noqa: S314
    of = [span.road for span in positions.spans]
    moves, length = 0, 0.0
    for row, road in enumerate(of):
        if road in inside:
            continue
        length += float(roads.length[row]) / 1e3
        for after in roads.successors(row).tolist():
            moves += of[after] != road
    sections = max(int(name.split(".")[1]) for name in roads.ids) + 1
    return moves, length, sections


def convert(sumo: Path, path: Path) -> tuple[int, float] | None:
    """Return the connections and the length of lanes outside of junctions [km] of netconvert; None if it fails."""
    with tempfile.TemporaryDirectory() as folder:
        net = Path(folder) / "net.xml"
        words = [str(sumo / "bin" / "netconvert"), "--opendrive-files", str(path), "-o", str(net), "--no-turnarounds"]
        words += ["--opendrive.import-all-lanes", "false", "--xml-validation", "never"]
        subprocess.run(words, env={**os.environ, "SUMO_HOME": str(sumo)}, capture_output=True, check=False)  # noqa: S603
        if not net.exists():
            return None
        root = ET.parse(net).getroot()  # noqa: S314
    edges = [edge for edge in root.iter("edge") if edge.get("function") != "internal"]
    length = sum(float(lane.get("length", "0")) for edge in edges for lane in edge.iter("lane")) / 1e3
    inner = [one for one in root.iter("connection") if not one.get("from", ":").startswith(":")]
    return len(inner), length


def main() -> None:
    """Run the judge on files."""
    sumo = Path(sys.argv[1])
    for path in map(Path, sys.argv[2:]):
        moves, length, sections = measure(path)
        other = convert(sumo, path)
        told = "netconvert fails" if other is None else f"netconvert {other[0]} movements, {other[1]:.2f} km"
        print(f"{path.name}: {moves} movements, {length:.2f} km, at most {sections} sections a road; {told}")


if __name__ == "__main__":
    main()
