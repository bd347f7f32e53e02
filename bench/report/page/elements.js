// Elements of the page. Only this file turns texts of a run into nodes, always text nodes, so that none is markup.

function element(tag, attributes = {}, ...children) {
  const node = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) {
    if (name.startsWith("on")) node.addEventListener(name.slice(2), value);
    else if (value === true) node.setAttribute(name, "");
    else if (value !== false && value !== undefined) node.setAttribute(name, value);
  }
  node.append(...children.flat().map((child) => (child instanceof Node ? child : String(child))));
  return node;
}

const place = (id) => document.getElementById(id);

function fill(id, ...children) {
  place(id).replaceChildren(...children.map((child) => (child instanceof Node ? child : String(child))));
}

// A chart with its heading and an explanation.
const figureOf = (title, note, id) => element("div", { class: "keep" },
  element("h4", {}, title), element("p", { class: "note" }, note), element("div", { id, class: "figure" }));

const NONE = "–";

// A time in engineering units, as in the tables of proxbench.
function duration(seconds) {
  if (!Number.isFinite(seconds)) return NONE;
  for (const [unit, size] of [["s", 1], ["ms", 1e-3], ["µs", 1e-6]]) {
    if (seconds >= 0.9995 * size) return `${digits(seconds / size, 3)} ${unit}`;
  }
  return `${digits(seconds / 1e-6, 2)} µs`;
}

const digits = (value, count) => (Number.isFinite(value) ? String(Number(value.toPrecision(count))) : NONE);
const power = (value, count = 1) => (!Number.isFinite(value) ? NONE : value === 0 ? "0" : value.toExponential(count - 1));

// A tolerance with all its digits, without rounding errors.
const exact = (tolerance) => Number(tolerance.toPrecision(10)).toExponential();

const SHAPES = {
  circle: "M-4,0a4,4 0 1,0 8,0a4,4 0 1,0 -8,0",
  square: "M-3.5,-3.5h7v7h-7z",
  "triangle-up": "M0,-4.5L4.5,3.5h-9z",
  "triangle-down": "M0,4.5L4.5,-3.5h-9z",
  diamond: "M0,-5L4,0L0,5L-4,0z",
  cross: "M-1.5,-4.5h3v3h3v3h-3v3h-3v-3h-3v-3h3z",
};

// Defines the colour of each solver as a variable of style, with another value on a dark screen.
function defineColours(solvers) {
  const rules = (name) => solvers.map((solver) => `${solver.variable}:${solver[name]}`).join(";");
  const style = `:root{${rules("colour")}} @media screen and (prefers-color-scheme: dark){:root{${rules("on_dark")}}}`;
  document.head.append(element("style", {}, style));
}

// The line and mark of a solver, as all charts draw it.
function swatch(solver) {
  const names = "http://www.w3.org/2000/svg";
  const drawing = document.createElementNS(names, "svg");
  const attributes = { width: 34, height: 12, viewBox: "0 0 34 12", class: "swatch", "aria-hidden": "true" };
  for (const [name, value] of Object.entries(attributes)) drawing.setAttribute(name, value);
  const line = document.createElementNS(names, "path");
  line.setAttribute("d", "M0,6H34");
  line.setAttribute("stroke", `var(${solver.variable})`);
  line.setAttribute("stroke-width", 2);
  line.setAttribute("stroke-dasharray", solver.dash.join(" "));
  const mark = document.createElementNS(names, "path");
  mark.setAttribute("d", SHAPES[solver.shape]);
  mark.setAttribute("transform", "translate(17,6)");
  mark.setAttribute("fill", `var(${solver.variable})`);
  drawing.append(line, mark);
  return drawing;
}

// A table that its heads sort. Columns: {name, numeric}; cells: {text, value, node, share}, or texts. A cue shows when
// columns are out of sight.
function table(columns, rows, caption) {
  const body = element("tbody");
  let sorted = null;
  const show = (ordered) => body.replaceChildren(...ordered.map((row) => element("tr", {}, row.map(cell))));
  function cell(one, index) {
    const { text, node, share } = typeof one === "object" ? one : { text: one };
    const kinds = [columns[index].numeric ? "number" : "words", share === undefined ? "" : "share"];
    const cellNode = element("td", { class: kinds.filter(Boolean).join(" ") }, node ?? text ?? NONE);
    if (share !== undefined) cellNode.style.setProperty("--share", `${Math.round(100 * share)}%`);
    return cellNode;
  }
  const value = (one) => (typeof one === "object" ? one.value ?? one.text : one);
  function sort(index) {
    const descends = sorted?.index === index && !sorted.descends;
    sorted = { index, descends };
    const known = (one) => one !== null && one !== undefined && !Number.isNaN(one);
    const ordered = [...rows].sort((a, b) => {
      const [x, y] = [value(a[index]), value(b[index])];
      if (!known(x) || !known(y)) return Number(known(y)) - Number(known(x)); // missing values are last
      const order = typeof x === "number" && typeof y === "number" ? x - y : String(x).localeCompare(String(y));
      return descends ? -order : order;
    });
    heads.forEach((head, k) => head.setAttribute("aria-sort", k !== index ? "none" : descends ? "descending" : "ascending"));
    show(ordered);
  }
  const heads = columns.map((column, index) =>
    element("th", { scope: "col", class: column.numeric ? "number" : "", "aria-sort": "none" },
      element("button", { type: "button", onclick: () => sort(index) }, column.name)));
  show(rows);
  const tableNode = element("table", { "aria-label": caption }, element("thead", {}, element("tr", {}, heads)), body);
  const scroll = element("div", { class: "scroll", tabindex: 0, role: "region", "aria-label": caption }, tableNode);
  const frame = element("div", { class: "frame" }, element("p", { class: "cue" }, "Scroll sideways for more columns →"), scroll);
  const mark = () => frame.classList.toggle("cut", scroll.scrollLeft + scroll.clientWidth < scroll.scrollWidth - 1);
  scroll.addEventListener("scroll", mark);
  new ResizeObserver(mark).observe(scroll);
  return frame;
}

// Rows as a file that the browser saves, without a request. An apostrophe precedes texts that a spreadsheet would run.
function csv(rows) {
  const quoted = (value) => {
    const known = value === null || value === undefined || Number.isNaN(value) ? "" : String(value);
    const text = known.replace(/\r\n?/g, "\n");
    const runs = typeof value === "string" && /^[=+\-@\t\n]/.test(text) && Number.isNaN(Number(text));
    const safe = runs ? `'${text}` : text;
    return /[",\n]/.test(safe) ? `"${safe.replaceAll('"', '""')}"` : safe;
  };
  const names = rows.length ? Object.keys(rows[0]) : [];
  return [names, ...rows.map((row) => names.map((name) => row[name]))].map((row) => row.map(quoted).join(",") + "\n").join("");
}

function save(name, text) {
  const address = URL.createObjectURL(new Blob([text], { type: "text/csv" }));
  element("a", { href: address, download: name }).click();
  setTimeout(() => URL.revokeObjectURL(address), 1000);
}
