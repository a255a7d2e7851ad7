"""A story: what a file of OpenSCENARIO, or the blocks of a JSON scenario, ask for; without XML.

`read_story` makes it of the texts of the file and its catalogues. The texts are kept with it: they are what a snapshot
has of a story.
"""

from __future__ import annotations

from collections.abc import Collection, Iterator, Mapping
from itertools import chain
from typing import Final

from rosbridge_sim.documents.xml_documents import Element, read_whole
from rosbridge_sim.errors import DocumentError
from rosbridge_sim.printable import printable
from rosbridge_sim.scenarios.openscenario.story_items import (
    MAX_NUMBER,
    StoryItemReader,
    evaluate,
    place_of,
)
from rosbridge_sim.scenarios.openscenario.story_records import MAX_STORY_BYTES, Findings, Story, StoryItem, StoryText
from rosbridge_sim.scenarios.openscenario.story_signals import check_controllers, check_states
from rosbridge_sim.scenarios.openscenario.storyboard import KINDS
from rosbridge_sim.suggestions import hint

MAX_ENTITIES: Final = 1_000
MAX_EVENTS: Final = 1_000
MAX_LOOKS: Final = 1_000
"""Most conditions, counted once for each of their triggering entities: a step looks at all, 0.03 to 0.1 ms each."""

MAX_FOLDERS: Final = 16
MAX_SHOWN: Final = 8
"""Refused things that an error names; `scenario check` lists all."""

EGO_NAMES: Final = ("ego", "ego_vehicle", "egovehicle", "ego vehicle", "hero", "host")
"""Names of the ego in files of MORAI, CARLA and esmini, in lower case."""


def catalogue_folders(text: bytes, source: str, parameters: Mapping[str, str]) -> list[str]:
    """Return the folders of catalogues that a scenario names, as it spells them, and the path of its map.

    Raises:
        DocumentError: it is no OpenSCENARIO, or it names too many.
    """
    root = _read_root(text, source)
    known = StoryItemReader({}, is_lenient=True).declare(root, {}, parameters)
    folders = []
    for location in root.within("CatalogLocations"):
        for folder in location.children:
            path = folder.attributes.get("path")
            if folder.tag == "Directory" and path is not None:
                folders.append(evaluate(path, known, place_of(folder)))
    if len(folders) > MAX_FOLDERS:
        raise DocumentError(f"{source}: expected at most {MAX_FOLDERS} folders of catalogues, got {len(folders)}")
    return list(dict.fromkeys(folders))


def declared_parameters(text: bytes, source: str) -> set[str]:
    """Return the names of the parameters of a scenario.

    Raises:
        DocumentError: it is no OpenSCENARIO.
    """
    return _declared(_read_root(text, source))


def _declared(root: Element) -> set[str]:
    return {each.attributes.get("name", "") for each in root.within("ParameterDeclarations")}


def _read_root(text: bytes, source: str) -> Element:
    if len(text) > MAX_STORY_BYTES:
        raise DocumentError(f"{source}: expected at most {MAX_STORY_BYTES:,} bytes, got {len(text):,}")
    return read_whole(text, source, "OpenSCENARIO")


def read_story(given: StoryText) -> Story:
    """Read a scenario and its catalogues.

    Raises:
        DocumentError: a file is wrong, or something in it is not supported and must not be left out. One line, with the
            file and the line of each.
    """
    story, findings = examine_story(given)
    refused = findings.refused if story is None else []  # what was left out was not in the way
    wrong = [*findings.mistakes, *refused]
    if wrong or story is None:
        more = f"; and {len(wrong) - MAX_SHOWN} more, see scenario check" if len(wrong) > MAX_SHOWN else ""
        aside = "; --lenient leaves out what is not supported" if refused and not findings.mistakes else ""
        raise DocumentError("; ".join(wrong[:MAX_SHOWN]) + more + aside)
    return story


def examine_story(given: StoryText) -> tuple[Story | None, Findings]:
    """Return the story of a file as far as there is one, and all that is told about the file.

    Raises:
        DocumentError: a file is no XML, or no OpenSCENARIO.
    """
    root = _read_root(given.text, given.source)
    if root.first("Storyboard") is None and root.first("Catalog") is not None:
        raise DocumentError(f"{given.source}: expected a scenario, got a catalogue")
    reader = StoryItemReader(_catalogues(given), is_lenient=given.is_lenient)
    findings = reader.findings
    parameters = reader.declare(root, {}, given.parameters)
    declared = _declared(root)
    for name in given.parameters:
        if name not in declared:
            findings.mistakes.append(f"{given.source}: no parameter {printable(name, 60)!r}{hint(name, declared)}")
    names = [each.attributes.get("name", "") for each in root.within("Entities")]
    if len(names) > MAX_ENTITIES:
        raise DocumentError(f"{given.source}: expected at most {MAX_ENTITIES:,} entities, got {len(names):,}")
    reader.entities = frozenset(evaluate(name, parameters, given.source) for name in names)
    if len(reader.entities) < len(names):
        findings.mistakes.append(f"{given.source}: two entities have the same name")
    item = reader.read(root, {}, given.parameters)
    if item is None:
        return None, findings
    story = _make(given, item, parameters, findings)
    check_story(story)
    return story, findings


def _catalogues(given: StoryText) -> dict[str, dict[str, Element]]:
    """Return the entries of all catalogues, by the names of both."""
    found: dict[str, dict[str, Element]] = {}
    for name, text in given.catalogues:
        catalogue = _read_root(text, name).first("Catalog")
        if catalogue is not None:
            entries = {entry.attributes.get("name", ""): entry for entry in catalogue.children}
            found.setdefault(catalogue.attributes.get("name", ""), {}).update(entries)
    return found


def _make(given: StoryText, root: StoryItem, parameters: Mapping[str, str], findings: Findings) -> Story:
    entities = {each["name"]: each for each in root.part("Entities").all("ScenarioObject")}
    board = root.part("Storyboard")
    variables = {each["name"]: each["value"] for each in root.within("VariableDeclarations")}
    network = root.find("RoadNetwork") or root
    controllers = {each["name"]: each for each in network.within("TrafficSignals")}
    if len(controllers) < len(network.within("TrafficSignals")):
        findings.mistakes.append(f"{network.where}: TrafficSignals: two controllers have the same name")
    logic = network.find("LogicFile")
    path = "" if logic is None else logic["filepath"]
    map_name = next((each["name"] for each in root.within("SimulatorInfo")), variables.get("moraiMap", ""))
    return Story(
        text=given,
        entities=entities,
        ego=choose_ego(given.ego, entities, given.source, findings),
        holds={name: _hold(item, findings) for name, item in entities.items() if item.find("Pedestrian") is not None},
        controllers=controllers,
        init=board.part("Init").part("Actions"),
        storyboard=board,
        evaluation=root.find("Evaluation"),
        parameters=parameters,
        variables={name: value for name, value in variables.items() if name != "moraiMap"},
        map_file="" if map_name or path.lower().rstrip("/").endswith("mgeo") else path,
        map_name=map_name,
        findings=findings,
    )


def _hold(entity: StoryItem, findings: Findings) -> tuple[float, float]:
    """Return the distances of a pedestrian, see `Story.holds`; 0 for one that is none, which the findings tell."""
    distances = {"activeDistance": 0.0, "moveDistance": 0.0}
    for item in entity.part("Pedestrian").within("Properties"):
        if item.get("name") in distances:
            try:
                value = float(item["value"])
            except ValueError:
                value = -1.0
            if not 0.0 <= value <= MAX_NUMBER:
                shown = printable(item["value"], 60)
                findings.mistakes.append(f"{item.where}: {item['name']}: expected a distance [m], got {shown!r}")
                continue
            distances[item["name"]] = value
    return distances["activeDistance"], distances["moveDistance"]


def choose_ego(wanted: str, entities: Mapping[str, StoryItem], source: str, findings: Findings) -> str:
    """Return the name of the ego: the wanted entity; else one with a usual name; else the first vehicle.

    Args:
        wanted: by the user; empty for the rule.
        findings: gets a line about the choice.
    """
    vehicles = [name for name, entity in entities.items() if entity.find("Vehicle") is not None]
    if wanted:
        if wanted not in vehicles:
            findings.mistakes.append(
                f"{source}: --ego-entity: no vehicle {printable(wanted, 60)!r}{hint(wanted, vehicles)}"
                f"; there are {', '.join(vehicles[:12]) or 'none'}"
            )
        return wanted
    for name in vehicles:
        role = entities[name].part("Vehicle").get("role", "")
        if name.lower() in EGO_NAMES or role == "ego":
            return name
    if vehicles:
        findings.notes.append(f"{source}: no entity is named Ego: {vehicles[0]!r}, the first vehicle, is the ego")
    return vehicles[0] if vehicles else ""


def check_story(story: Story) -> None:
    """Check names that refer to something within the story, and numbers; the findings get the mistakes."""
    mistakes, source = story.findings.mistakes, story.text.source
    names = element_names(story.storyboard)
    phases = {name: [phase["name"] for phase in item.parts] for name, item in story.controllers.items()}
    check_controllers(story.controllers, mistakes)
    num_events = num_looks = 0
    items = list(chain(each_item(story.storyboard), () if story.evaluation is None else each_item(story.evaluation)))
    check_states(items, story.findings.notes if story.text.is_lenient else mistakes)
    known = {"variableRef": story.variables, "parameterRef": story.parameters, "trafficSignalControllerRef": phases}
    for item in items:
        num_events += item.kind == "Event"
        num_looks += _count_looks(item)
        for key in item.values:
            if key in known:
                _check_name(item, key, item[key], known[key], mistakes)
            elif key == "phase":
                _check_name(item, key, item[key], phases.get(item["trafficSignalControllerRef"], [item[key]]), mistakes)
            elif key == "storyboardElementRef":
                name, there = item[key].rpartition("::")[2], names[item["storyboardElementType"]]
                _check_name(item, key, name, there, story.findings.notes if story.text.is_lenient else mistakes)
    if num_events > MAX_EVENTS:
        mistakes.append(f"{source}: expected at most {MAX_EVENTS:,} events, got {num_events:,}")
    if num_looks > MAX_LOOKS:
        mistakes.append(
            f"{source}: expected at most {MAX_LOOKS:,} conditions of entities and values, and vertices of positions"
            f" in them, got {num_looks:,}"
        )


def _check_name(item: StoryItem, key: str, name: str, known: Collection[str], lines: list[str]) -> None:
    """Add a line if nothing has a name that an item refers to."""
    if name not in known:
        lines.append(f"{item.where}: {item.kind}.{key}: there is no {printable(name, 60)!r}{hint(name, sorted(known))}")


def _count_looks(item: StoryItem) -> int:
    """Return how many looks of a frame an item costs: a position on a trajectory finds all its vertices each time."""
    if item.kind == "TrajectoryPosition":
        return sum(each.kind == "Vertex" for each in each_item(item))
    return len(item.parts) if item.kind == "TriggeringEntities" else int(item.kind == "ByValueCondition")


ELEMENT_TYPES: Final = {kind[0].lower() + kind[1:]: kind for kind in KINDS[1:]}
"""Types in `StoryboardElementStateCondition` -> kinds of items."""


def element_names(board: StoryItem) -> dict[str, set[str]]:
    """Return the names of a storyboard's elements, by type."""
    items = list(each_item(board))
    return {name: {each.get("name", "") for each in items if each.kind == kind} for name, kind in ELEMENT_TYPES.items()}


def each_item(item: StoryItem) -> Iterator[StoryItem]:
    """Yield an item and all within it, in order."""
    yield item
    for part in item.parts:
        yield from each_item(part)
