/**
 * All texts of the page that a person reads, one object for each part. A function makes a text with values.
 * `texts_ko.js` has the same in Korean: a new text needs a line there, too.
 */

export const TEXTS = {
  page: {
    name: "rosbridge-sim",
    skip: "Skip to the controls",
    map: "Map of the simulation",
    controls: "Controls",
    language: "Language",
  },
  mapView: {
    canvas: "Map of the simulation. Arrow keys move it, + and - zoom, C changes the camera, ? lists all keys.",
    noWebGl: "This browser has no WebGL 2, so the map is not drawn. All other parts of the page work.",
    /** @param {string} reason */
    failed: (reason) => `The map cannot be drawn: ${reason}. All other parts of the page work.`,
    toolbar: "Map",
    chase: "Camera behind the car",
    follow: "Follow the car",
    zoomIn: "Zoom in",
    zoomOut: "Zoom out",
    wholeMap: "Show the whole map",
    northUp: "North up",
    turnLeft: "Turn to the left",
    turnRight: "Turn to the right",
    measure: "Measure a distance",
    help: "Keys and colours",
    measureHint: "Click two points. Esc ends.",
    /** @param {string} key */
    withKey: (key) => ` (${key})`,
    /** @param {string} x @param {string} y */
    coordinates: (x, y) => `x ${x} m, y ${y} m`,
    /** @param {number} number */
    ego: (number) => (number === 0 ? "Ego" : `Ego ${number}`),
    /** @param {string} kind @param {number} id */
    entity: (kind, id) => `${kind} ${id}`,
    kinds: { ego: "Ego", vehicle: "Vehicle", pedestrian: "Pedestrian", obstacle: "Obstacle" },
    /** @param {string} a @param {string} b */
    collision: (a, b) => `Collision: ${a} and ${b}`,
    /** @param {string} seconds */
    meeting: (seconds) => `${seconds} s`,
    /** @param {number} seconds */
    timeLeft: (seconds) => `${seconds}`,
  },
  start: {
    label: "Ways to begin",
    /** @type {Record<string, string>} */
    about: {
      demo: "A closed track with two lanes, made for the first command.",
      town: "A town with lights and crosswalks, cars that give way, and people who cross the streets.",
      loop: "A closed road with three one-way lanes, for lane changes at speed.",
      hills: "A hilly road in the shape of an eight, with a bridge over itself.",
      motorway: "Three lanes of a motorway, with vehicles at different speeds and an exit ahead.",
      rush_hour: "A motorway on which new vehicles enter all the time.",
      roundabout: "A roundabout with four arms, crosswalks and no lights.",
      parking: "A car park with narrow aisles, parked cars, and some that drive.",
    },
    /** @param {number} vehicles @param {number} pedestrians */
    counts: (vehicles, pedestrians) => `A scene with ${vehicles} other vehicles and ${pedestrians} pedestrians.`,
    letDrive: { label: "Let it drive", title: "The ego drives itself along the lanes, and the camera follows it" },
    drive: { label: "Drive with the keys", title: "Drive with the keyboard, a game pad or touch pads" },
    copy: { label: "Copy a first program", title: "Copy a Python program that drives this ego" },
    copied: "Copied. Save it as drive.py, then: pip install roslibpy; python drive.py",
    program: "First program",
    close: "Close",
  },
  mapHelp: {
    title: "Map: keys and colours",
    close: "Close",
    keys: "Keys",
    colours: "Colours",
    documentation: "Documentation of this page and all others",
    rows: [
      ["C", "Camera above the map or behind the car"],
      ["V", "Next camera: above, behind, driver's seat, around"],
      ["F", "Follow the selected object or the ego, or stop"],
      ["+  -", "Zoom; also with the wheel and two fingers"],
      ["Arrow keys", "Move the map; behind the car, look around. Also by dragging"],
      [",  .", "Turn the map; also by dragging with the right button"],
      ["N", "North up"],
      ["0", "Show the whole map"],
      ["M", "Measure a distance between two clicks"],
      ["O  Shift+O", "Select the next or the previous object"],
      ["Esc", "End measuring, or close the card of the object"],
      ["?", "This help"],
    ],
    legend: {
      ego: "ego",
      vehicle: "vehicle",
      pedestrian: "pedestrian",
      obstacle: "obstacle",
      lane: "lane",
      inside: "within an intersection",
      deadEnd: "dead end",
      stop: "stop line",
      red: "red light: a disc",
      yellow: "yellow light: a diamond",
      green: "green light: an arrow",
      dark: "light that is off",
      contact: "collision",
    },
  },
  objectCard: {
    close: "Close",
    label: "Selected object",
    id: "Id",
    model: "Model",
    speed: "Speed",
    lane: "Lane",
    noLane: "on no lane",
    /** @param {string} link @param {string} distance @param {string} lateral */
    lanePlace: (link, distance, lateral) => `${link}, ${distance} m along, ${lateral} m to the left`,
    next: "Next lanes",
    place: "Place",
    heading: "Heading",
    controlled: "Controlled by",
    does: "Now",
    follows: "Follows",
    stops: "Stops for",
    /** @param {string} name @param {string} gap */
    gap: (name, gap) => `${name}, gap ${gap} m`,
    /** @param {string} what @param {string} distance */
    stopIn: (what, distance) => `${what}, in ${distance} m`,
    givesWay: "Gives way to",
    reasons: { light: "light", right_of_way: "right of way", no_room: "no room behind the intersection", end: "end of the road" },
    /** @param {number} kmh */
    kmh: (kmh) => `${kmh.toFixed(1)} km/h`,
    followThis: "Follow",
  },
  contacts: {
    /** @param {number} total */
    title: (total) => `Collisions (${total})`,
    clear: "Clear the list of collisions",
    /** @param {number} frame @param {string} a @param {string} b @param {string} speed */
    line: (frame, a, b, speed) => `frame ${frame}: ${a} and ${b}, ${speed} km/h`,
    goThere: "Show the place",
  },
  connection: {
    connecting: "Connecting …",
    token: "This server needs a token.",
    open: "Connected",
    silent: "No answer",
    silentBanner: "The server is connected and does not answer. What you see is the last state that it sent.",
    /** @param {string} reason */
    lost: (reason) => `The connection is lost${reason ? ` (${reason})` : ""}. The page connects again by itself.`,
    back: "Connected again.",
    notConnected: "The page is not connected to the server.",
    lostMeanwhile: "The connection was lost before the answer came.",
    /** @param {string} service @param {number} seconds */
    noAnswer: (service, seconds) => `${service} did not answer within ${seconds} s.`,
    /** @param {string} service */
    refused: (service) => `${service} failed without a reason.`,
    refusedUnread: "no answer, or the server refused this page; its log says why",
  },
  token: {
    title: "Token",
    ask: "This server needs a token. Its owner has set it with --token.",
    label: "Token",
    send: "Connect",
    checking: "The server checks the token …",
    wrong: "The token is wrong.",
    kept: "The page keeps it until this tab is closed.",
  },
  tabs: {
    label: "Panels",
    ego: "Ego",
    time: "Time",
    objects: "Objects",
    graph: "Graph",
    log: "Log",
    code: "Code",
    empty: "Nothing to see here yet.",
    show: "Show the panels",
    hide: "Hide the panels",
  },
  actions: {
    refused: "The server refused it without a reason.",
  },
  ego: {
    title: "Ego",
    none: "–",
    choice: "Ego",
    /** @param {number} number */
    egoName: (number) => (number > 1 ? `Ego ${number}` : "Ego 1 (first)"),
    speedUnit: "km/h",
    throttle: "Throttle",
    brake: "Brake",
    mode: "Control mode",
    driver: "Driver",
    /** @type {Record<string, string>} */
    drivers: { "self-driving": "drives itself", replay: "a recording", nobody: "nobody" },
    thisPage: "this page",
    /** @param {string} driver */
    headerDriver: (driver) => `Driver: ${driver}`,
    /** @param {string} address */
    client: (address) => `client ${address}`,
    place: "Place",
    heading: "Heading",
    lane: "Lane",
    offRoad: "on no lane",
    gears: "Gear",
    /** @param {string} gear */
    setGear: (gear) => `Gear ${gear}`,
    /** @param {string} degrees @param {number} side - positive to the left */
    wheelAngle: (degrees, side) => (side === 0 ? "straight" : `${degrees}° ${side > 0 ? "left" : "right"}`),
    /** @param {string} angle */
    wheelName: (angle) => `Steering wheel: front wheels ${angle}`,
    /** @param {string} x @param {string} y @param {string} z */
    placeText: (x, y, z) => `${x}, ${y}, ${z} m`,
    /** @param {string} degrees */
    headingText: (degrees) => `${degrees}°`,
    lamps: { left: "Left signal", right: "Right signal", brake: "Brake lights", reverse: "Reversing lights" },
    lampSigns: { left: "◀", right: "▶", brake: "■", reverse: "R", hazard: "◀▶" },
    lampsGroup: "Signals",
    lampButtons: { left: "Left turn signal", right: "Right turn signal", hazard: "Hazard lights" },
    /** @param {string} name @param {boolean} isOn */
    lampName: (name, isOn) => `${name}: ${isOn ? "on" : "off"}`,
    /** @type {Record<number, string>} */
    modes: { 1: "keyboard (1)", 2: "game pad (2)", 3: "program (3)", 6: "drives itself (6)" },
    /** @type {Record<number, string>} */
    modeButtons: { 3: "Program", 6: "Self-driving" },
    /** @type {Record<number, string>} */
    modeHints: { 3: "A program or this page drives the ego", 6: "The ego drives itself along the lanes" },
    charts: { speed: "Speed", acceleration: "Acceleration", steering: "Front wheels (left positive)", offset: "Distance to the lane's middle" },
  },
  charts: {
    hold: "Hold",
    follow: "Follow",
    holdHint: "Hold the charts still, to read values from them",
    save: "Save as CSV",
    saveHint: "Save the values of these charts as a table",
    none: "–",
    noSecond: "alone",
    secondHint: "A second signal in this chart, with its own range at the right",
    /** @param {string} label */
    second: (label) => `Second signal in the chart of ${label}`,
    /** @param {string} label */
    chart: (label) => `Chart of ${label}, last two minutes; arrow keys move the cursor`,
    /** @param {string} value @param {string} secondsAgo */
    reading: (value, secondsAgo) => `${value}, ${secondsAgo} s ago`,
    /** @param {string} label */
    remove: (label) => `Remove the chart of ${label}`,
    full: "Six charts are the most. Remove one first.",
  },
  view: {
    title: "View",
    camera: "Camera",
    cameras: { top: "Above the map", chase: "Behind the car", seat: "Driver's seat", orbit: "Around the car" },
    motion: "Motion",
    marks: { showsVelocities: "Velocities", showsMeetings: "Time to collision" },
    hints: {
      showsVelocities: "A vector for the way of one second",
      showsMeetings: "Seconds until the followed car would touch another one, if both kept speed and direction; up to 5 s",
    },
    save: { label: "Save picture", title: "Save the map as it is seen, as PNG" },
    record: { label: "Record clip", title: "Record the map without its labels as WebM, at most 60 s" },
    stop: { label: "End the clip", title: "End the clip, and save it" },
    emptyClip: "The clip was ended before its first picture.",
    noRecorder: "This browser records no clips.",
    noMap: "This browser draws no map.",
    copy: { label: "Copy link", title: "Copy a link to this scenario, camera, object and panel; a token is never in it" },
    copied: "Copied:",
    link: {
      /** @param {string} name @param {string} value @param {string} expected */
      problem: (name, value, expected) => (expected ? `The link has ${name}=${value}: expected ${expected}.` : `The link has ${name}, which this page does not know.`),
      /** @param {number} id */
      noEntity: (id) => `The link follows ${id}, which is not in this scene.`,
      /** @param {string} name */
      title: (name) => `Load the scenario ${name}?`,
      body: "The link wants this scenario. It replaces the world of all clients of this server.",
      confirm: "Load",
    },
  },
  timeline: {
    title: "Timeline",
    position: "Place in the last two minutes",
    live: "live",
    /** @param {string} seconds */
    ago: (seconds) => `-${seconds} s`,
    /** @param {string} seconds @param {number} frame */
    banner: (seconds, frame) => `${seconds} s ago, frame ${frame}`,
    worldGoesOn: "You see the past.",
    backToLive: { label: "Back to live", title: "Show what happens now" },
    play: { label: "▶", title: "Play from here" },
    hold: { label: "❚❚", title: "Hold" },
    scrollFirst: "Scroll back first: move the slider to the left.",
    marks: { collision: "Collision", red: "Red light passed", lane: "Lane change", refusal: "Refused request" },
    /** @param {string} kind @param {string} text @param {string} seconds */
    mark: (kind, text, seconds) => `${kind}, ${seconds} s ago: ${text}`,
    /** @param {number} count */
    keep: (count) => (count > 0 ? `Keep snapshots (${count})` : "Keep snapshots"),
    keepHint: "The server keeps a snapshot every 10 s, twelve at most, so that you can branch from the past",
    /** @param {string} reason */
    keepFailed: (reason) => `No more snapshots are kept: ${reason}`,
    branch: { label: "Branch here …", title: "Return the world to the nearest snapshot, and move it by steps" },
    noSnapshot: "The server has no snapshot of this time. Switch on Keep snapshots before you need one.",
    branchDialog: {
      title: "Branch from the past?",
      /** @param {number} frame @param {string} seconds */
      body: (frame, seconds) => `The world of all clients returns to the snapshot of frame ${frame} (${seconds} s from the moment that you see), and stands in synchronous mode of this page. What has happened since then is lost.`,
      confirm: "Branch",
    },
    /** @param {number} frame */
    branched: (frame) => `The world stands at frame ${frame}. Step or run it in the panel Time.`,
  },
  driving: {
    title: "Drive",
    action: "Drive",
    begin: { label: "Drive by hand", title: "Drive with the keyboard, a game pad or touch pads" },
    end: { label: "End the drive", title: "Lift the pedals, and give the car back (Escape)" },
    on: "You drive: ↑ ↓ ← → or W A S D.",
    onTouch: "You drive: the left pad steers, the right one is throttle and brake.",
    onInSteps: "You drive: hold the keys, and step with the button or the full stop key.",
    onInStepsTouch: "You drive: hold the pads, and press Step.",
    step: { label: "Step", title: "One step of synchronous mode with the pedals as you hold them; the page becomes its master" },
    /** @param {number} throttle @param {number} brake @param {string} angle */
    live: (throttle, brake, angle) => `Throttle ${throttle} %, brake ${brake} %, wheels ${angle}`,
    endedHidden: "The drive has ended, because the page was hidden. The pedals are up.",
    endedLost: "The drive has ended, because the connection was lost.",
    /** @param {string} mode */
    endedMode: (mode) => `The drive has ended, because the control mode of the ego is now: ${mode}.`,
    otherEgo: "The drive has not begun, because another ego was chosen.",
    takeMode: "Control mode: program",
    gearDrive: "Gear D",
    gearReverse: "Gear R",
    stopFirst: "Stop first: the gear changes between D and R only while the car stands.",
    steerPad: "Steering pad: move the thumb to the left or right",
    pedalPad: "Pedal pad: upwards is throttle, downwards is brake",
    /** @param {string} addresses */
    otherPublishers: (addresses) => `Another client publishes commands for this ego, too: ${addresses}. The latest command holds.`,
    keysTitle: "Keys and game pad",
    keys: [
      ["↑ or W", "throttle"],
      ["↓ or S, Space", "brake"],
      ["← → or A D", "steer; less at high speed"],
      ["R", "change between gear D and R, while the car stands"],
      [".", "one step, in synchronous mode of this page"],
      ["Esc", "end the drive"],
      ["Game pad", "left stick steers, right trigger is throttle, left trigger is brake"],
    ],
  },
  score: {
    title: "Score",
    none: "–",
    hint: "Scores judge the drive. They begin to count when you show them, and they are then part of the state hash.",
    start: { label: "Show scores", title: "Begin to count, and show the figures" },
    stop: { label: "Hide scores", title: "Show no figures; the server goes on counting" },
    reset: { label: "Set to 0", title: "Begin all counts anew" },
    fields: {
      distance: "Driven",
      collisions: "Collisions",
      red_lights: "Red lights passed",
      stop_lines: "Stop lines passed",
      lane_invasions: "Lane invasions",
      off_road_time: "Off the road",
      min_time_to_collision: "Least time to collision",
      mean_lane_offset: "Mean distance to the lane's middle",
      max_jerk: "Greatest jerk",
      max_lateral_accel: "Greatest sideways acceleration",
    },
  },
  sensors: {
    title: "Cameras and lidars",
    hint: "The server draws them only while somebody looks, and that takes it a core.",
    none: "This ego has neither. Start the server with --sensors teaching, or add some by /sim/sensors.",
    start: { label: "Show cameras and lidars", title: "Pictures here, with boxes; points of lidars on the map" },
    live: "as it is now",
    large: "Large",
    largeHint: "Show this picture over the map, or back here",
    stop: { label: "Hide cameras and lidars", title: "Listen to them no longer" },
    /** @param {string} name */
    lidar: (name) => `The points of ${name} are on the map.`,
  },
  time: {
    title: "Time",
    none: "–",
    cancel: "Cancel",
    states: {
      unknown: "Not connected",
      running: "Running in real time",
      paused: "Paused",
      /** @param {boolean} isPaused @returns {string} */
      replay: (isPaused) => (isPaused ? "Replay, paused" : "Replay"),
      /** @param {string} master @param {boolean} isPaused */
      synchronous: (master, isPaused) => `Synchronous, master: ${master}${isPaused ? "; paused" : ""}`,
    },
    /** @param {number} frame */
    headerFrame: (frame) => `frame ${frame}`,
    ownMaster: "this page",
    noMaster: "none yet",
    figures: {
      frame: "Frame",
      simTime: "Simulated time",
      timeStep: "Time step",
      ticks: "Ticks",
      factor: "Real-time factor",
      members: "Members of the barrier",
    },
    buttons: {
      pause: { label: "Pause", title: "Hold the world" },
      run: { label: "Run", title: "Let real time move the world; ends a pause and synchronous mode of this page" },
      step: { label: "Step", title: "Move the world by steps; takes synchronous mode first" },
      take: { label: "Take synchronous mode", title: "The world stands, and this page moves it by steps" },
      leave: { label: "Leave it", title: "End synchronous mode" },
      reset: { label: "Reset …", title: "Return to the opening scene at frame 0" },
      factor: { label: "Set", title: "Set the real-time factor" },
      snapshot: { label: "Save", title: "Save the state of the whole simulator" },
      restore: { label: "Go back", title: "Return to this state" },
      removeSnapshot: { label: "Remove", title: "Remove this snapshot" },
      refresh: { label: "↻", title: "Read the list again" },
      load: { label: "Load", title: "Load this scenario" },
    },
    steps: "Steps",
    timeStep: "Time step [ms]",
    seed: "Random seed",
    seedHint: "as before",
    resetDialog: {
      title: "Reset the simulation?",
      body: "The world returns to its opening scene at frame 0. Snapshots and synchronous mode stay.",
      confirm: "Reset",
    },
    resetDone: "The simulation stands at frame 0.",
    factor: "Real-time factor",
    /** @param {number} factor */
    factorName: (factor) => (factor === 0 ? "as fast as possible" : `${factor} ×`),
    /** @param {number} factor */
    factorDone: (factor) => (factor === 0 ? "The world runs as fast as possible." : `The world runs at ${factor} × real time.`),
    /** @param {string} label */
    badNumber: (label) => `${label}: expected a whole number in the range of the field.`,
    snapshots: {
      title: "Snapshots",
      name: "Name",
      nameHint: "the server chooses",
      empty: "No snapshots yet.",
      refreshName: "Read the list of snapshots again",
      /** @param {string} id */
      restoreName: (id) => `Go back to ${id}`,
      /** @param {string} id */
      removeName: (id) => `Remove ${id}`,
      /** @param {number} frame @param {number} size */
      about: (frame, size) => `frame ${frame}, ${(size / 1000).toFixed(0)} kB`,
      /** @param {string} id @param {number} frame */
      taken: (id, frame) => `Saved as ${id}, at frame ${frame}.`,
      /** @param {string} id @param {number} frame */
      restored: (id, frame) => `Back at ${id}, frame ${frame}.`,
    },
    scenarios: {
      title: "Scenarios",
      open: "Scenario: show all, with pictures",
      name: "Name of a scenario",
      noName: "Enter the name of a scenario first.",
      /** @param {string} name */
      loadName: (name) => `Load ${name}`,
      /** @param {string} name */
      loading: (name) => `The server reads ${name} …`,
      /** @param {string} name */
      loaded: (name) => `Loaded ${name}.`,
      /** @param {string} map @param {number} entities */
      about: (map, entities) => `${map ? `map ${map}, ` : ""}${entities} ${entities === 1 ? "entity" : "entities"}`,
      isLoaded: "loaded now",
    },
    replay: {
      title: "Replay",
      file: "Recording",
      speed: "Speed",
      position: "Position in the recording",
      none: "No recording is played.",
      noFiles: "The server has no recordings in --data-dir.",
      plays: "The recording is played already.",
      play: { label: "Play", title: "Play the recording" },
      pause: { label: "Hold", title: "Hold the replay" },
      stop: { label: "End", title: "End the replay; the world returns to its state before" },
      /** @param {string} name */
      playTitle: (name) => `Play ${name}`,
      /** @param {string} seconds */
      seekTitle: (seconds) => `Replay from ${seconds} s`,
      /** @param {string} position @param {string} duration */
      clock: (position, duration) => `${position} / ${duration} s`,
    },
    actions: {
      pause: "Pause",
      run: "Run",
      take: "Take synchronous mode",
      leave: "Leave synchronous mode",
      /** @param {number} steps */
      step: (steps) => (steps === 1 ? "Step" : `${steps} steps`),
      reset: "Reset",
      /** @param {number} factor */
      factor: (factor) => `Real-time factor ${factor}`,
      snapshot: "Snapshot",
      /** @param {string} id */
      restore: (id) => `Go back to ${id}`,
      /** @param {string} id */
      removeSnapshot: (id) => `Remove snapshot ${id}`,
      /** @param {string} name */
      load: (name) => `Load scenario ${name}`,
    },
    reasons: {
      notConnected: "Not connected to the simulator.",
      moving: "The world moves by a step of this page.",
      /** @param {string} name */
      otherMaster: (name) => `${name} is the master of synchronous mode.`,
      alreadyPaused: "The simulation is paused already.",
      alreadyRuns: "The world runs already.",
      syncStands: "In synchronous mode the world stands between two steps.",
      alreadyMaster: "This page is the master already.",
      notMaster: "This page is not the master of synchronous mode.",
      replaying: "A recording moves the ego.",
      noFactorInSync: "In synchronous mode the steps move the world.",
    },
  },
  objects: {
    title: "Objects",
    placeTitle: "Place an object",
    selectedTitle: "Move and remove",
    lightsTitle: "Traffic lights",
    search: "Search the catalogue",
    catalogue: "Model",
    dragHint: "Drag the name beside the button onto the map, or press the button.",
    /** @param {string} name @param {string} kind @param {number} length @param {number} width */
    model: (name, kind, length, width) => `${name} (${kind}, ${length.toFixed(1)} × ${width.toFixed(1)} m)`,
    /** @type {Record<string, string>} */
    kinds: { vehicle: "vehicle", pedestrian: "pedestrian", obstacle: "obstacle" },
    behaviour: "Behaviour",
    behaviours: { stand: "stands", straight: "goes straight on", lane: "drives along the lanes" },
    speed: "Speed [km/h]",
    isEgo: "as a further ego",
    byNumbers: "By coordinates",
    x: "x, east [m]",
    y: "y, north [m]",
    heading: "Heading [°]",
    badPlace: "x, y and heading: expected numbers.",
    noModel: "Choose a model first.",
    noMap: "The map cannot be drawn here. Use the coordinates.",
    spawnPick: { label: "Place on the map …", title: "Click the place; drag to turn it" },
    spawnAt: { label: "Place here", title: "Place the object at these coordinates" },
    pickHint: "Click the place of the object. Drag to turn it. Escape gives it up.",
    /** @param {string} model */
    spawnTitle: (model) => `Place ${model}`,
    /** @param {string} model @param {string} ids */
    spawned: (model, ids) => `${model} is object ${ids}.`,
    undo: { label: "Undo", title: "Take the latest change back" },
    nothingToUndo: "There is no change to take back.",
    /** @param {string} title */
    undoTitle: (title) => `Undo: ${title}`,
    /** @type {Record<number, string>} */
    kindNames: { 0: "Ego", 1: "Vehicle", 2: "Pedestrian", 3: "Obstacle" },
    /** @param {string} kind @param {number} id */
    objectName: (kind, id) => (kind === "Ego" ? `Ego ${id > 1 ? id : 1}` : `${kind} ${id}`),
    /** @param {string} name */
    noneSelected: (name) => `Nothing is selected on the map. Move works on ${name}.`,
    selectFirst: "Select an object on the map first.",
    firstEgo: "The first ego cannot be removed.",
    movePick: { label: "Move on the map …", title: "Click the new place; drag to turn it" },
    moveAt: { label: "Move there", title: "Move it to these coordinates" },
    moveHint: "Click the new place. Drag to turn it. Escape gives it up.",
    /** @param {string} name */
    moveTitle: (name) => `Move ${name}`,
    /** @param {string} name */
    moved: (name) => `${name} stands at its new place.`,
    remove: { label: "Remove", title: "Take it out of the world" },
    /** @param {string} name */
    removeTitle: (name) => `Remove ${name}`,
    /** @param {string} name */
    removed: (name) => `${name} is removed.`,
    noLights: "This map has no traffic lights.",
    light: "Light",
    lightGroup: "The light shows",
    lightStates: { red: "Red", yellow: "Yellow", green: "Green", left: "Left", greenLeft: "Green and left", schedule: "Its schedule" },
    /** @param {string} light @param {string} state */
    lightTitle: (light, state) => `Light ${light}: ${state}`,
  },
  drawn: {
    title: "What programs publish",
    hint: "The map draws Path, Marker, MarkerArray, PoseStamped, Odometry, PointCloud2 and LaserScan, in the frame map or any frame of /tf.",
    empty: "No program publishes one of these types.",
    noMap: "This browser draws no map.",
    /** @param {string} name */
    colour: (name) => `Colour of ${name}`,
    /** @param {string} name */
    keep: (name) => `How long ${name} is drawn`,
    keeps: { 0: "until the next message", 1: "for 1 s", 10: "for 10 s" },
    waiting: "no message yet",
    /** @param {string} seconds */
    age: (seconds) => `${seconds} s old`,
    notes: {
      refused: "The server does not let this page subscribe to it.",
      bytes: "Switched off: it brought more than 4 MB in a second.",
      /** @param {string} frame */
      frame: (frame) => `The frame ${frame} has no transform to map. Publish it on /tf.`,
      cut: "A part is not drawn: it is more than the limits, or of a kind that the map has not.",
    },
  },
  code: {
    title: "Copy as code",
    hint: "What you do on this page, as a program. Choose an action below.",
    program: "Program",
    language: "Language",
    languages: { python: "roslibpy", javascript: "roslib.js", shell: "Shell" },
    copy: { label: "Copy", title: "Copy the program" },
    copied: "Copied.",
    empty: "Nothing was done yet. Press a button of this page, and its program appears here.",
    actions: "Latest actions",
    outcomes: { waiting: "under way", done: "done", failed: "refused" },
    /** @param {string} reason */
    failed: (reason) => `refused: ${reason}`,
    syncEnds: "Synchronous mode ends when this program disconnects: send the ticks here, with this user_id.",
    syncShell: "A master must stay connected. This command starts the mode, does one step, and ends the mode.",
  },
  graph: {
    title: "Graph",
    /** @param {number} count */
    more: (count) => `${count} more: search for them.`,
    /** @param {string} type @param {string} reason */
    noDefinition: (type, reason) => `No fields for ${type}: ${reason}. Write JSON text.`,
    topics: {
      title: "Topics",
      search: "Search topics, types",
      empty: "No topic matches.",
      name: "Topic",
      rate: "Hz",
      size: "Size",
      publishers: "Pub.",
      subscribers: "Sub.",
      dropped: "Lost",
    },
    topic: {
      label: "Chosen topic",
      bytes: "Traffic",
      dropped: "Lost by slow clients",
      latched: "Kept for new subscribers",
      publishers: "Publishers",
      subscribers: "Subscribers",
      nobody: "none",
      yes: "yes",
      no: "no",
      none: "No message yet.",
      live: "Latest message. Click a number, or press Enter on it, for a chart.",
      held: "Held. The page does not receive this topic now.",
      gone: "This topic is gone.",
      hold: "Hold",
      go: "Go on",
      holdTitle: "Keep this message, and receive no other one",
      close: "Close",
    },
    tree: {
      label: "Message",
      cut: "There are more rows. Close some nodes to see them.",
      choose: "Show or remove a chart",
    },
    image: {
      label: "Image of the topic",
      unknown: "The browser cannot show this format. It shows PNG, JPEG and WebP.",
      /** @param {number} width @param {number} height */
      size: (width, height) => `${width} × ${height} pixels`,
    },
    form: {
      json: "Write as JSON",
      fields: "Write as fields",
      jsonLabel: "Message as JSON",
      noFields: "No fields.",
      other: "another value",
      add: "Add",
      remove: "Remove",
      /** @param {number} count */
      items: (count) => `a list of at most ${count} messages; longer ones as JSON`,
      /** @param {string} path @param {string} what */
      expected: (path, what) => `${path}: expected ${what}`,
      notObject: "Expected a JSON object, such as {}",
      list: "a JSON list, such as [1, 2]",
      /** @param {number} count */
      listOf: (count) => `a JSON list of ${count}`,
    },
    publish: {
      title: "Publish a message",
      label: "Publish",
      hint: "Publish this message once",
      done: "Published.",
      /** @param {string} topic */
      action: (topic) => `Publish ${topic}`,
    },
    services: {
      title: "Services",
      search: "Search services, actions",
      empty: "No service matches.",
      name: "Name",
      kind: "Kind",
      kinds: { service: "service", action: "action" },
      label: "Chosen service",
      call: "Call",
      answer: "Answer",
      emptyAnswer: "Done. The answer has no fields.",
      /** @param {string} service */
      action: (service) => `Call ${service}`,
      /** @param {string} type */
      aboutAction: (type) => `${type || "actionlib"}: an action. Send goals with a program.`,
    },
    clients: {
      title: "Clients",
      hint: "A client that reads too slowly has waiting bytes. Then it loses messages, the oldest first.",
      search: "Search clients",
      empty: "No client matches.",
      address: "Address",
      thisPage: "this page",
      bridges: "Remote bridges",
      /** @param {string} url @param {number} seconds */
      bridge: (url, seconds) => `Attached to ${url}: messages are ${seconds.toFixed(2)} s old when it handles them`,
      time: "Connected",
      received: "Frames in",
      refused: "Refused",
      sent: "Sent",
      waiting: "Waiting",
      held: "Memory",
      /** @param {string} topic @param {number} count */
      lost: (topic, count) => `lost ${count} of ${topic}`,
    },
  },
  log: {
    title: "Log",
    hint: "Refused requests of all clients, and messages to this page; log lines while this panel is shown.",
    /** @param {number} count */
    unseen: (count) => `${count} new ${count === 1 ? "mistake" : "mistakes"}`,
    openLog: "Open the log",
    level: "Level",
    levels: { debug: "Debug", info: "Info", warning: "Warning", error: "Error" },
    search: "Search",
    hold: "Hold",
    go: "Go on",
    holdTitle: "Keep these lines; new ones come when you go on",
    clear: "Clear",
    empty: "No lines.",
    statusSource: "status",
  },
};
