// The report's own script: a table that sorts and filters, and a picture of two parameters. Nothing is loaded.

/**
 * @typedef {string | number | boolean | null} Cell
 * @typedef {{columns: Record<string, Cell[]>, parameters: string[], strongest: string[], scores: string[],
 *   paths: (number[] | null)[], shown: number[]}} Data
 */

"use strict";

(() => {
  /** @template {HTMLElement} T @param {string} id @param {new () => T} kind @returns {T} */
  function byId(id, kind) {
    const found = document.getElementById(id);
    if (!(found instanceof kind)) {throw new Error(`no ${id}`);}
    return found;
  }

  const data = /** @type {Data} */ (JSON.parse(byId("data", HTMLScriptElement).text));
  const { columns, parameters, scores } = data;
  const num = columns.run.length;
  const shown = new Set(data.shown);
  const PAGE = 100;
  /** @param {string} name */
  const varies = (name) => columns[name].some((value) => value !== columns[name][0]);
  const FIRST = ["run", "verdict", ...["driver", "scenario", "seed", ...parameters].filter(varies), "reason"];
  const VERDICTS = ["pass", "fail", "error", "flaky", "skipped"];

  /** @param {Cell} value */
  function told(value) {
    if (value === null) {return "";}
    if (typeof value === "number") {return Number.isInteger(value) ? `${value}` : `${+value.toPrecision(6)}`;}
    return `${value}`;
  }

  /** @param {number} count */
  const counted = (count) => count.toLocaleString("en");

  /** @param {HTMLSelectElement} select @param {string[]} values */
  function fill(select, values) {
    select.replaceChildren(...values.map((value) => new Option(value, value)));
  }

  // The table

  const verdict = byId("verdict", HTMLSelectElement);
  const driver = byId("driver", HTMLSelectElement);
  const text = byId("text", HTMLInputElement);
  const allColumns = byId("scores", HTMLInputElement);
  const table = byId("table", HTMLTableElement);
  const earlier = byId("earlier", HTMLButtonElement);
  const later = byId("later", HTMLButtonElement);
  fill(verdict, ["all", "not passed", ...VERDICTS.filter((each) => columns.verdict.includes(each))]);
  fill(driver, ["all", ...new Set(columns.driver.map(told))]);

  const words = Array.from({ length: num }, (_, i) =>
    [
      `run=${columns.run[i]}`,
      told(columns.driver[i]),
      told(columns.scenario[i]),
      `seed=${columns.seed[i]}`,
      ...parameters.map((name) => `${name}=${told(columns[name][i])}`),
      told(columns.reason[i]),
    ]
      .join(" ")
      .toLowerCase(),
  );
  const sorting = { column: "run", sign: 1 };
  /** @type {number[]} */
  let chosen = [];
  let first = 0;

  function choose() {
    const wanted = text.value.toLowerCase().split(/[\s,]+/u);
    chosen = [];
    for (let i = 0; i < num; i += 1) {
      const is = columns.verdict[i];
      const fits = verdict.value === "all" || is === verdict.value;
      const isBad = verdict.value === "not passed" && is !== "pass" && is !== "skipped";
      const drives = driver.value === "all" || told(columns.driver[i]) === driver.value;
      if ((fits || isBad) && drives && wanted.every((word) => words[i].includes(word))) {chosen.push(i);}
    }
    const values = columns[sorting.column];
    chosen.sort((a, b) => sorting.sign * compare(values[a], values[b]) || a - b);
    first = 0;
    showRows();
  }

  /** @param {Cell} a @param {Cell} b */
  function compare(a, b) {
    if (a === null || b === null) {return Number(a === null) - Number(b === null);}
    if (typeof a === "number" && typeof b === "number") {return a - b;}
    return `${a}`.localeCompare(`${b}`, "en", { numeric: true });
  }

  function showHead() {
    const names = allColumns.checked ? Object.keys(columns) : FIRST;
    const cells = [...names, "path"].map((name) => {
      const cell = document.createElement("th");
      cell.scope = "col";
      if (name === "path") {
        cell.textContent = name;
        return cell;
      }
      const button = document.createElement("button");
      button.type = "button";
      const isSorted = name === sorting.column;
      button.textContent = isSorted ? `${name} ${sorting.sign > 0 ? "▲" : "▼"}` : name;
      button.addEventListener("click", () => {
        sorting.sign = isSorted ? -sorting.sign : 1;
        sorting.column = name;
        showHead();
        choose();
        /** @type {HTMLElement | null} */ (table.querySelector("th[aria-sort] button"))?.focus();
      });
      if (isSorted) {cell.ariaSort = sorting.sign > 0 ? "ascending" : "descending";}
      cell.append(button);
      return cell;
    });
    const row = document.createElement("tr");
    row.append(...cells);
    table.tHead?.replaceChildren(row);
  }

  function showRows() {
    const names = allColumns.checked ? Object.keys(columns) : FIRST;
    const rows = chosen.slice(first, first + PAGE).map((i) => {
      const row = document.createElement("tr");
      for (const name of names) {
        const cell = row.insertCell();
        const value = columns[name][i];
        cell.textContent = told(value);
        if (typeof value === "number") {cell.className = "number";}
        if (name === "verdict") {cell.className = told(value);}
        if (name === "reason") {
          cell.className = "reason";
          cell.title = told(value);
        }
        if (name === "run" && shown.has(Number(value))) {
          const link = document.createElement("a");
          link.href = `#run-${value}`;
          link.textContent = told(value);
          cell.replaceChildren(link);
        }
      }
      row.insertCell().append(pathOf(data.paths[i]));
      return row;
    });
    table.tBodies[0].replaceChildren(...rows);
    if (table.caption) {table.caption.textContent = `${counted(chosen.length)} of ${counted(num)} runs`;}
    const last = Math.min(first + PAGE, chosen.length);
    byId("place", HTMLSpanElement).textContent = chosen.length ? `${first + 1} to ${last}` : "none";
    earlier.disabled = first === 0;
    later.disabled = last >= chosen.length;
  }

  /** @param {number[] | null} path x, y, x, y, ... */
  function pathOf(path) {
    const space = "http://www.w3.org/2000/svg";
    const svg = document.createElementNS(space, "svg");
    svg.setAttribute("class", "path");
    svg.setAttribute("aria-hidden", "true");
    if (!path || path.length < 4) {return svg;}
    const xs = path.filter((_, i) => i % 2 === 0);
    const ys = path.filter((_, i) => i % 2 === 1);
    const [left, low] = [Math.min(...xs), Math.min(...ys)];
    const size = Math.max(Math.max(...xs) - left, (Math.max(...ys) - low) * 2.5, 1);
    const line = document.createElementNS(space, "polyline");
    const scale = 68 / size;
    const points = xs.map((x, i) => `${(2 + (x - left) * scale).toFixed(1)},${(26 - (ys[i] - low) * scale).toFixed(1)}`);
    line.setAttribute("points", points.join(" "));
    line.setAttribute("class", "curve");
    svg.append(line);
    return svg;
  }

  // The picture of two parameters

  const canvas = byId("picture", HTMLCanvasElement);
  const across = byId("across", HTMLSelectElement);
  const up = byId("up", HTMLSelectElement);
  const colour = byId("colour", HTMLSelectElement);
  const form = byId("form", HTMLSelectElement);
  /** @param {string} name */
  const isNumeric = (name) => columns[name].every((value) => typeof value === "number" || value === null);
  const axes = [...parameters, "seed", ...scores].filter(isNumeric);
  fill(across, axes);
  fill(up, axes);
  fill(colour, ["verdict", ...scores.filter(isNumeric)]);
  if (axes.length > 1) {up.selectedIndex = 1;}
  // At first the two parameters that explain most of what came out, and one driver: a cell of several has the worst of them.
  data.strongest.forEach((name, k) => {[across, up][k].value = name;});
  if (across.value === up.value) {up.value = axes.find((name) => name !== across.value) ?? up.value;}
  const drivers = [...new Set(columns.driver.map(told))];
  const pictured = byId("pictured", HTMLSelectElement);
  pictured.replaceChildren(...drivers.map((name) => new Option(name, name)), new Option("all", ""));
  byId("pictured-label", HTMLElement).hidden = drivers.length < 2;
  form.value = isGrid(chooseRows()) ? "map" : "points";
  const MARGIN = { left: 64, right: 12, top: 10, bottom: 40 };

  /** @param {string} name */
  function colourNamed(name) {
    return getComputedStyle(document.documentElement).getPropertyValue(`--${name}`).trim();
  }

  /** @param {number} share 0 the least value, 1 the greatest */
  function shade(share) {
    return `hsl(${Math.round(30 + 190 * share)} 70% ${Math.round(40 + 22 * share)}%)`;
  }

  /** @param {number[]} values */
  function rangeOf(values) {
    let low = Infinity;
    let high = -Infinity;
    for (const value of values) {
      if (value < low) {low = value;}
      if (value > high) {high = value;}
    }
    return low < high ? [low, high] : [low - 0.5, low + 0.5];
  }

  /** @returns {number[]} the runs of the picture */
  function chooseRows() {
    /** @type {number[]} */
    const rows = [];
    for (let i = 0; i < num; i += 1) {
      const places = [columns[across.value]?.[i], columns[up.value]?.[i]];
      const drives = pictured.value === "" || told(columns.driver[i]) === pictured.value;
      if (drives && places.every((value) => typeof value === "number") && columns.verdict[i] !== "skipped") {rows.push(i);}
    }
    return rows;
  }

  /** @param {number[]} rows @returns {boolean} whether a quarter of the cells at least have a run: of samples none has two */
  function isGrid(rows) {
    const [wide, high] = [across, up].map((select) => new Set(rows.map((i) => columns[select.value][i])).size);
    return wide * high <= 4 * rows.length;
  }

  function draw() {
    const ratio = window.devicePixelRatio || 1;
    const { clientWidth: width, clientHeight: height } = canvas;
    canvas.width = Math.round(width * ratio);
    canvas.height = Math.round(height * ratio);
    const pen = canvas.getContext("2d");
    if (!pen) {return;}
    pen.scale(ratio, ratio);
    pen.clearRect(0, 0, width, height);
    const rows = chooseRows();
    if (!rows.length) {
      byId("picture-text", HTMLParagraphElement).textContent = "There is no parameter with numbers.";
      return;
    }
    const xs = rows.map((i) => Number(columns[across.value][i]));
    const ys = rows.map((i) => Number(columns[up.value][i]));
    const box = { x: MARGIN.left, y: MARGIN.top, w: width - MARGIN.left - MARGIN.right, h: height - MARGIN.top - MARGIN.bottom };
    const counts = form.value === "map" ? drawCells(pen, box, rows, xs, ys) : drawPoints(pen, box, rows, xs, ys);
    byId("picture-text", HTMLParagraphElement).textContent = counts;
  }

  /** @typedef {{x: number, y: number, w: number, h: number}} Box */

  /** @param {number[]} rows @returns {(i: number) => string} */
  function colours(rows) {
    if (colour.value === "verdict") {
      const found = Object.fromEntries(VERDICTS.map((name) => [name, colourNamed(name)]));
      return (i) => found[told(columns.verdict[i])];
    }
    const values = rows.map((i) => columns[colour.value][i]).filter((value) => typeof value === "number");
    const [low, high] = rangeOf(/** @type {number[]} */ (values));
    return (i) => {
      const value = columns[colour.value][i];
      return typeof value === "number" ? shade((value - low) / (high - low)) : colourNamed("line");
    };
  }

  function legend() {
    const named = colour.value === "verdict" ? "colour: verdict" : `colour: ${colour.value}, from orange (least) to blue`;
    const whose = drivers.length > 1 && pictured.value !== "" ? `; driver ${pictured.value}` : "";
    return `${across.value} across, ${up.value} up${whose}; ${named}`;
  }

  /** @param {CanvasRenderingContext2D} pen @param {Box} box @param {number[]} rows @param {number[]} xs @param {number[]} ys */
  function drawPoints(pen, box, rows, xs, ys) {
    const [left, right] = rangeOf(xs);
    const [low, high] = rangeOf(ys);
    const colourOf = colours(rows);
    const size = rows.length > 2000 ? 2 : 3.5;
    rows.forEach((i, k) => {
      pen.fillStyle = colourOf(i);
      pen.beginPath();
      const x = box.x + 6 + ((xs[k] - left) / (right - left)) * (box.w - 12);
      const y = box.y + box.h - 6 - ((ys[k] - low) / (high - low)) * (box.h - 12);
      pen.arc(x, y, size, 0, 7);
      pen.fill();
    });
    drawAxes(pen, box, [left, right], [low, high]);
    return `${rows.length} runs. ${legend()}.`;
  }

  /**
   * Each cell has the worst verdict, or the least value, of its runs. A line runs between cells that pass and that do not.
   *
   * @param {CanvasRenderingContext2D} pen
   * @param {Box} box
   * @param {number[]} rows
   * @param {number[]} xs
   * @param {number[]} ys
   */
  function drawCells(pen, box, rows, xs, ys) {
    const [column, numColumns, xEnds] = binsOf(xs);
    const [line, numLines, yEnds] = binsOf(ys);
    const colourOf = colours(rows);
    /** @type {Map<number, number>} */
    const cells = new Map();
    const worst = { fail: 0, error: 1, flaky: 2, pass: 3, skipped: 4 };
    /** @param {number} i */
    const rank = (i) =>
      colour.value === "verdict"
        ? worst[/** @type {keyof typeof worst} */ (told(columns.verdict[i]))]
        : Number(columns[colour.value][i] ?? Infinity);
    rows.forEach((i, k) => {
      const key = column(xs[k]) * numLines + line(ys[k]);
      const there = cells.get(key);
      if (there === undefined || rank(i) < rank(there)) {cells.set(key, i);}
    });
    const w = box.w / numColumns;
    const h = box.h / numLines;
    /** @param {number | undefined} i */
    const passes = (i) => i !== undefined && columns.verdict[i] === "pass";
    for (const [key, i] of cells) {
      const [c, l] = [Math.floor(key / numLines), key % numLines];
      pen.fillStyle = colourOf(i);
      pen.fillRect(box.x + c * w, box.y + box.h - (l + 1) * h, w + 0.5, h + 0.5);
    }
    pen.strokeStyle = colourNamed("ink");
    pen.lineWidth = 2.5;
    pen.beginPath();
    for (const [key, i] of cells) {
      const [c, l] = [Math.floor(key / numLines), key % numLines];
      const right = c + 1 < numColumns ? cells.get(key + numLines) : undefined;
      const above = l + 1 < numLines ? cells.get(key + 1) : undefined;
      const [x, y] = [box.x + c * w, box.y + box.h - (l + 1) * h];
      if (right !== undefined && passes(right) !== passes(i)) {
        pen.moveTo(x + w, y);
        pen.lineTo(x + w, y + h);
      }
      if (above !== undefined && passes(above) !== passes(i)) {
        pen.moveTo(x, y);
        pen.lineTo(x + w, y);
      }
    }
    pen.stroke();
    drawAxes(pen, box, xEnds, yEnds);
    const good = [...cells.values()].filter(passes).length;
    return `${cells.size} cells of ${rows.length} runs, ${good} pass; the line is the border between pass and the rest. ${legend()}.`;
  }

  /**
   * A bin for each value, or fifty equal ones.
   *
   * @param {number[]} values
   * @returns {[(value: number) => number, number, number[]]} bin of a value, their number, and the ends of the axis
   */
  function binsOf(values) {
    const each = [...new Set(values)].sort((a, b) => a - b);
    const [low, high] = rangeOf(values);
    if (each.length > 60) {
      return [(value) => Math.min(Math.floor(((value - low) / (high - low)) * 50), 49), 50, [low, high]];
    }
    const place = new Map(each.map((value, i) => [value, i]));
    return [(value) => place.get(value) ?? 0, each.length, [each[0], each[each.length - 1]]];
  }

  /** @param {CanvasRenderingContext2D} pen @param {Box} box @param {number[]} xEnds @param {number[]} yEnds */
  function drawAxes(pen, box, xEnds, yEnds) {
    pen.strokeStyle = colourNamed("ink-2");
    pen.lineWidth = 1;
    pen.strokeRect(box.x, box.y, box.w, box.h);
    pen.fillStyle = colourNamed("ink");
    pen.font = "13px system-ui, sans-serif";
    pen.textAlign = "left";
    pen.fillText(told(xEnds[0]), box.x, box.y + box.h + 16);
    pen.textAlign = "right";
    pen.fillText(told(xEnds[1]), box.x + box.w, box.y + box.h + 16);
    pen.fillText(told(yEnds[1]), box.x - 6, box.y + 12);
    pen.fillText(told(yEnds[0]), box.x - 6, box.y + box.h);
    pen.textAlign = "center";
    pen.fillText(across.value, box.x + box.w / 2, box.y + box.h + 32);
    pen.save();
    pen.translate(14, box.y + box.h / 2);
    pen.rotate(-Math.PI / 2);
    pen.fillText(up.value, 0, 0);
    pen.restore();
  }

  // Beginning

  for (const id of ["table-form", "picture-form"]) {
    byId(id, HTMLFormElement).addEventListener("submit", (event) => event.preventDefault());
  }
  byId("table-form", HTMLFormElement).addEventListener("input", () => {
    showHead();
    choose();
  });
  byId("picture-form", HTMLFormElement).addEventListener("input", draw);
  earlier.addEventListener("click", () => {
    first = Math.max(first - PAGE, 0);
    showRows();
  });
  later.addEventListener("click", () => {
    first += PAGE;
    showRows();
  });
  window.addEventListener("hashchange", openDetails);
  window.addEventListener("resize", draw);
  window.matchMedia("(prefers-color-scheme: dark)").addEventListener("change", draw);

  function openDetails() {
    const found = document.getElementById(location.hash.slice(1));
    if (found instanceof HTMLDetailsElement) {found.open = true;}
  }

  showHead();
  choose();
  draw();
  openDetails();
})();
