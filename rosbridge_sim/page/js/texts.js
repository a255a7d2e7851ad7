/**
 * All texts of the page that a person reads, one object for each part. A function makes a text with values.
 */

export const TEXTS = {
  page: {
    name: "rosbridge-sim",
    skip: "Skip to the controls",
    map: "Map of the simulation",
    controls: "Controls",
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
    /**
     * @param {string} x
     * @param {string} y
     */
    coordinates: (x, y) => `x ${x} m, y ${y} m`,
    /** @param {number} number */
    ego: (number) => (number === 0 ? "Ego" : `Ego ${number}`),
    /**
     * @param {string} kind
     * @param {number} id
     */
    entity: (kind, id) => `${kind} ${id}`,
    kinds: { ego: "Ego", vehicle: "Vehicle", pedestrian: "Pedestrian", obstacle: "Obstacle" },
    /** @param {number} seconds */
    timeLeft: (seconds) => `${seconds}`,
  },
  mapHelp: {
    title: "Map: keys and colours",
    close: "Close",
    keys: "Keys",
    colours: "Colours",
    rows: [
      ["C", "Camera above the map or behind the car"],
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
    /**
     * @param {string} link
     * @param {string} distance
     * @param {string} lateral
     */
    lanePlace: (link, distance, lateral) => `${link}, ${distance} m along, ${lateral} m to the left`,
    next: "Next lanes",
    place: "Place",
    heading: "Heading",
    controlled: "Controlled by",
    does: "Now",
    follows: "Follows",
    stops: "Stops for",
    /**
     * @param {string} name
     * @param {string} gap
     */
    gap: (name, gap) => `${name}, gap ${gap} m`,
    /**
     * @param {string} what
     * @param {string} distance
     */
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
    /**
     * @param {number} frame
     * @param {string} a
     * @param {string} b
     * @param {string} speed
     */
    line: (frame, a, b, speed) => `frame ${frame}: ${a} and ${b}, ${speed} km/h`,
    goThere: "Show the place",
  },
  connection: {
    connecting: "Connecting …",
    token: "This server needs a token.",
    open: "Connected",
    /** @param {string} reason */
    lost: (reason) => `The connection is lost${reason ? ` (${reason})` : ""}. The page connects again by itself.`,
    back: "Connected again.",
    notConnected: "The page is not connected to the server.",
    lostMeanwhile: "The connection was lost before the answer came.",
    /**
     * @param {string} service
     * @param {number} seconds
     */
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
};
