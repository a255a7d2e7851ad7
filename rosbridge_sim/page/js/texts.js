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
