// The page at work: its state follows from the address and the filters, and everything shown follows from its state.

const run = decoded(JSON.parse(place("run").textContent));
let state = stateOf(run, location.hash) ?? defaults(run);
const figures = Object.fromEntries(["performance", "data", "accuracy", "speedup"].map((name) => [name, new Figure(run, name, name)]));
const PROFILES = { performance: performanceProfile, data: dataProfile, accuracy: accuracyProfile, speedup: speedups };
const TABLES = {
  summary: summaryTable, budgets: budgetsTable, families: familiesTable, problems: problemsTable,
  failures: failuresTable, unsupported: unsupportedTable,
};

const linkTo = (changes) => addressOf(run, { ...state, case: null, ...changes });

// Changes the state, notes it in the address, and shows it.
function change(changes) {
  Object.assign(state, changes);
  history.replaceState(null, "", addressOf(run, state));
  return render();
}

// Shows the view; resolves when its charts are drawn.
async function render() {
  const view = { ...viewOf(run, state), linkTo };
  const parts = state.isSplit ? byFamily(view) : [{ family: "", ...view }];
  place("counts").textContent =
    `${view.problems.length} of ${run.problems.length} problems, ${view.solvers.length} of ${run.solvers.length} solvers, ` +
    `to a ${run.run.residual} residual of ${exact(view.accuracy)}` +
    (view.problems.length && view.solvers.length ? "" : "; nothing matches the filters: select more");
  place("key").replaceChildren(...view.solvers.map((solver) => element("span", {}, swatch(solver), solver.name)));
  place("baseline-name").textContent = view.baseline;
  for (const [name, makeTable] of Object.entries(TABLES)) fill(`${name}-table`, makeTable(view));
  place("profiles-over").textContent = `Shares are ${profileView(view, view.isCommon).over}.`;
  place("performance-threads").textContent = otherThreads(profileView(view, view.isCommon));
  place("speedup-threads").textContent = otherThreads(view, view.baseline);
  const group = (name, { family, ...part }) => {
    const own = name === "accuracy" ? part : comparedView(part);
    const shown = name === "speedup" ? own : profileView(own, view.isCommon);
    return { label: family, rows: part.problems.length ? PROFILES[name](shown) : [], axis: shown.axis };
  };
  const drawings = Object.entries(figures).map(([name, figure]) => figure.show(parts.map((part) => group(name, part))));
  await Promise.all([...drawings, renderDetail(view)]);
}

async function renderDetail(view) {
  const drawings = [];
  const across = { cost: "residual", convergence: "iteration" };
  const show = (id, name, rows) => drawings.push(new Figure(run, name, id, across[name]).show([{ label: "", rows }]));
  const problem = run.problems.find(({ name }) => name === state.problem);
  const solver = run.solvers.find(({ name }) => name === state.case);
  const names = run.solvers.map(({ name }) => name);
  place("detail-choice").replaceChildren(
    select("Problem", run.problems.map(({ name }) => name), state.problem, (name) => { location.hash = linkTo({ problem: name }); }),
    select("Solver", ["(all shown)", ...names], state.case ?? "(all shown)",
      (name) => { location.hash = linkTo({ case: names.includes(name) ? name : null }); }),
  );
  fill("problem-view", ...problemView(view, problem));
  show("cost", "cost", costRows(run, problem, view.solvers));
  show("convergence", "convergence", curveRows(run, problem, view.solvers));
  const one = solver && run.find(problem, solver);
  fill("case-view", ...(one ? caseView(view, problem, solver, one) : solver ? [element("p", { class: "note" }, "This case is not measured.")] : []));
  if (one) {
    show("own-cost", "cost", costRows(run, problem, [solver]));
    show("own-convergence", "convergence", curveRows(run, problem, [solver]));
  }
  await Promise.all(drawings);
}

function select(label, names, selected, change) {
  const options = names.map((name) => element("option", { value: name, selected: name === selected }, name));
  return element("label", { class: "field" }, label, element("select", { onchange: (event) => change(event.target.value) }, options));
}

function number(label, name) {
  const usual = defaults(run)[name];
  const take = (event) => change({ [name]: event.target.value === "" ? usual : Number(event.target.value) });
  const value = state[name] === usual ? "" : state[name];
  return element("input", { type: "number", min: 0, value, "aria-label": `contacts, ${label}`, placeholder: label, onchange: take });
}

function checkboxes(name, title, text) {
  const values = filterValues(run, name);
  const hide = (hidden) => change({ hidden: { ...state.hidden, [name]: new Set(hidden) } });
  const boxes = values.map((value) => {
    const take = (event) => hide(values.filter((one) => (one === value ? !event.target.checked : state.hidden[name].has(one))));
    const box = element("input", { type: "checkbox", name, checked: !state.hidden[name].has(value), onchange: take });
    return element("label", {}, box, ...text(value));
  });
  const all = (isChecked) => () => { hide(isChecked ? [] : values); buildFilters(); };
  const buttons = [element("button", { type: "button", onclick: all(true) }, "all"), " ", element("button", { type: "button", onclick: all(false) }, "none")];
  return element("fieldset", {}, element("legend", {}, title), ...(boxes.length > 2 ? buttons : []), ...boxes);
}

function buildFilters() {
  const accuracies = new Map(run.accuracies.map((accuracy) => [exact(accuracy), accuracy]));
  const accuracy = [...accuracies.keys()][run.accuracies.indexOf(state.accuracy)];
  const split = element("input", { type: "checkbox", checked: state.isSplit, onchange: (event) => change({ isSplit: event.target.checked }) });
  const name = element("input", { type: "search", value: state.name, oninput: (event) => change({ name: event.target.value }) });
  const [common, all] = ["common problems", "all problems"];
  const isOpen = place("filters").querySelector("details")?.open ?? matchMedia("(min-width: 801px)").matches;
  const plain = (value) => [element("span", {}, value)];
  const solver = (value) => [swatch(run.solvers.find((one) => one.name === value)), element("span", {}, value)];
  fill("filters", element("details", { open: isOpen }, element("summary", {}, "Filters"),
    select("Accuracy", [...accuracies.keys()], accuracy, (text) => change({ accuracy: accuracies.get(text) })),
    select("Baseline", run.solvers.map((one) => one.name), state.baseline, (baseline) => change({ baseline })),
    select("Profiles over", [common, all], state.isCommon ? common : all, (text) => change({ isCommon: text === common })),
    element("label", {}, split, "profiles by family"),
    element("label", { class: "field" }, "Problem name", name),
    element("fieldset", {}, element("legend", {}, "Number of contacts"),
      element("div", { class: "pair" }, number("at least", "fewest"), number("at most", "most"))),
    checkboxes("family", "Family", plain), checkboxes("law", "Law", plain), checkboxes("model", "Model", plain),
    checkboxes("solver", "Solver", solver),
    element("button", { type: "button", onclick: () => { change(defaults(run)); buildFilters(); } }, "Reset"),
  ));
}

function buildHead() {
  document.title = `Proxbench: ${run.run.id}`;
  place("title").textContent = `Proxbench run ${run.run.title}`;
  place("sentences").replaceChildren(...run.run.sentences.map((sentence) => element("li", {}, sentence)));
  place("command").textContent = run.run.command;
  fill("machine-tables", element("div", { class: "columns" },
    Object.entries(run.machine).map(([name, pairs]) => element("div", {}, element("h3", {}, name), facts(pairs)))));
  for (const id of ["starts", "starts-link"]) place(id).hidden = !run.starts.length;
  fill("starts-table", startsTable(run.starts));
  defineColours(run.solvers);
}

// Opens what the address names, after a link, a choice of the reader or the button "back".
async function follow() {
  const named = stateOf(run, location.hash);
  if (!named) return; // a section, to which the browser scrolls by itself
  const isOpened = named.problem !== state.problem || named.case !== state.case;
  state = named;
  buildFilters();
  await render();
  if (isOpened) showDetail();
}

function showDetail() {
  place(state.case === null ? "detail" : "case-view").scrollIntoView();
  place("detail").focus({ preventScroll: true });
}

addEventListener("hashchange", follow);
place("filters").addEventListener("submit", (event) => event.preventDefault());
buildHead();
buildFilters();
await render();
if (state.case !== null || state.problem !== run.open) showDetail();
window.proxbench = { figures, render }; // the rows behind each chart, for the console
