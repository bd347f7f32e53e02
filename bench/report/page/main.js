// The page at work: filters choose a view, everything shown follows from it, and addresses name what is open.

const run = decoded(JSON.parse(place("run").textContent));
const everything = (items) => items.map((_, index) => index);
const distinct = (values) => [...new Set(values)];
const FILTERS = {
  family: distinct(run.problems.map(({ family }) => family)),
  law: distinct(run.problems.map(({ law }) => law)),
  model: distinct(run.solvers.map(({ model }) => model)),
  solver: everything(run.solvers),
};
const chosen = {
  ...Object.fromEntries(Object.entries(FILTERS).map(([name, values]) => [name, new Set(values)])),
  fewest: 0, most: Infinity, name: "", accuracy: run.accuracy, baseline: run.baseline, split: false, isCommon: true,
};
const open = { problem: 0, solver: null };
const figures = Object.fromEntries(["performance", "data", "accuracy", "speedup"].map((name) => [name, new Figure(run, name, name)]));
const PROFILES = { performance: performanceProfile, data: dataProfile, accuracy: accuracyProfile, speedup: speedups };

function currentView() {
  const isShown = ({ name, family, law, contacts }) =>
    chosen.family.has(family) && chosen.law.has(law) && contacts >= chosen.fewest && contacts <= chosen.most &&
    name.toLowerCase().includes(chosen.name);
  return {
    run,
    problems: everything(run.problems).filter((problem) => isShown(run.problems[problem])),
    solvers: everything(run.solvers).filter((solver) => chosen.solver.has(solver) && chosen.model.has(run.solvers[solver].model)),
    accuracy: chosen.accuracy,
    baseline: chosen.baseline,
    isCommon: chosen.isCommon,
  };
}

// Shows the view; resolves when its charts are drawn.
async function render() {
  const view = currentView();
  const parts = chosen.split ? byFamily(view) : [{ family: "", ...view }];
  place("counts").textContent =
    `${view.problems.length} of ${run.problems.length} problems, ${view.solvers.length} of ${run.solvers.length} solvers, ` +
    `to a ${run.run.residual} residual of ${power(view.accuracy)}` +
    (view.problems.length && view.solvers.length ? "" : ": nothing matches the filters, choose more of them");
  place("key").replaceChildren(...view.solvers.map((solver) => element("span", {}, swatch(run.solvers[solver]), run.solvers[solver].name)));
  place("baseline-name").textContent = run.solvers[view.baseline].name;
  const tables = { summary: summaryTable, budgets: budgetsTable, families: familiesTable, problems: problemsTable, endings: endingsTable };
  for (const [name, made] of Object.entries(tables)) fill(`${name}-table`, made(view));
  place("profiles-over").textContent = `Shares ${profileView(view, view.isCommon).over}.`;
  const group = (name, { family, ...part }) => {
    const own = name === "accuracy" ? part : comparedView(part);
    const shown = name === "speedup" ? own : profileView(own, view.isCommon);
    return { label: family, rows: part.problems.length ? PROFILES[name](shown) : [], axis: shown.axis };
  };
  const drawn = Object.entries(figures).map(([name, figure]) => figure.show(parts.map((part) => group(name, part))));
  await Promise.all([...drawn, renderDetail(view)]);
}

async function renderDetail(view) {
  const drawn = [];
  const across = { cost: "residual", convergence: "iteration" };
  const show = (id, name, rows) => drawn.push(new Figure(run, name, id, across[name]).show([{ label: "", rows }]));
  place("detail-choice").replaceChildren(
    select("Problem", run.problems.map(({ name }) => name), open.problem, (index) => { location.hash = `#problem-${index}`; }),
    select("Solver", ["(all shown)", ...run.solvers.map(({ name }) => name)], open.solver === null ? 0 : open.solver + 1,
      (index) => { location.hash = index ? `#case-${open.problem}-${index - 1}` : `#problem-${open.problem}`; }),
  );
  fill("problem-view", ...problemView(view, open.problem));
  show("cost", "cost", costRows(run, open.problem, view.solvers));
  show("convergence", "convergence", curveRows(run, open.problem, view.solvers));
  const one = open.solver === null ? null : run.at(open.problem, open.solver);
  fill("case-view", ...(one ? caseView(view, one) : open.solver === null ? [] : [element("p", { class: "note" }, "This case is not measured.")]));
  if (one) {
    show("own-cost", "cost", costRows(run, open.problem, [open.solver]));
    show("own-convergence", "convergence", curveRows(run, open.problem, [open.solver]));
  }
  await Promise.all(drawn);
}

function select(label, names, index, change) {
  const options = names.map((name, k) => element("option", { value: k, selected: k === index }, name));
  return element("label", { class: "field" }, label, element("select", { onchange: (event) => change(Number(event.target.value)) }, options));
}

function number(label, name, otherwise) {
  const change = (event) => { chosen[name] = event.target.value === "" ? otherwise : Number(event.target.value); render(); };
  return element("input", { type: "number", min: 0, "aria-label": `contacts, ${label}`, placeholder: label, onchange: change });
}

function checkboxes(name, title, text) {
  const boxes = FILTERS[name].map((value) => {
    const change = (event) => { chosen[name][event.target.checked ? "add" : "delete"](value); render(); };
    return element("label", {}, element("input", { type: "checkbox", name, checked: true, onchange: change }), ...text(value));
  });
  const all = (isChecked) => () => {
    for (const box of place("filters").querySelectorAll(`input[name="${name}"]`)) box.checked = isChecked;
    chosen[name] = new Set(isChecked ? FILTERS[name] : []);
    render();
  };
  const buttons = [element("button", { type: "button", onclick: all(true) }, "all"), " ", element("button", { type: "button", onclick: all(false) }, "none")];
  return element("fieldset", {}, element("legend", {}, title), ...(boxes.length > 2 ? buttons : []), ...boxes);
}

function buildFilters() {
  const accuracies = run.accuracies.map((accuracy) => power(accuracy, 4).replace(/\.?0+e/, "e"));
  const split = element("input", { type: "checkbox", onchange: (event) => { chosen.split = event.target.checked; render(); } });
  const name = element("input", { type: "search", oninput: (event) => { chosen.name = event.target.value.toLowerCase(); render(); } });
  const isWide = matchMedia("(min-width: 801px)").matches;
  fill("filters", element("details", { open: isWide }, element("summary", {}, "Filters"),
    select("Accuracy", accuracies, run.accuracies.indexOf(run.accuracy), (index) => { chosen.accuracy = run.accuracies[index]; render(); }),
    select("Baseline", run.solvers.map((solver) => solver.name), run.baseline, (index) => { chosen.baseline = index; render(); }),
    select("Profiles over", ["common problems", "all problems"], 0, (index) => { chosen.isCommon = index === 0; render(); }),
    element("label", {}, split, "profiles by family"),
    element("label", { class: "field" }, "Problem", name),
    element("fieldset", {}, element("legend", {}, "Size [contacts]"),
      element("div", { class: "pair" }, number("at least", "fewest", 0), number("at most", "most", Infinity))),
    checkboxes("family", "Family", (value) => [element("span", {}, value)]),
    checkboxes("law", "Law", (value) => [element("span", {}, value)]),
    checkboxes("model", "Model", (value) => [element("span", {}, value)]),
    checkboxes("solver", "Solver", (value) => [swatch(run.solvers[value]), element("span", {}, run.solvers[value].name)]),
  ));
}

function buildHead() {
  document.title = `Proxbench: ${run.run.id}`;
  const suite = run.run.suite ? `, suite ${run.run.suite}` : "";
  place("title").textContent = `Proxbench run ${run.run.id}${suite}`;
  place("sentences").replaceChildren(...run.run.sentences.map((sentence) => element("li", {}, sentence)));
  place("command").textContent = run.run.command;
  fill("machine-tables", element("div", { class: "columns" },
    Object.entries(run.machine).map(([name, pairs]) => element("div", {}, element("h3", {}, name), facts(pairs)))));
}

// Opens what the address names: #problem-3, or #case-3-5 with the number of the solver behind it.
async function follow() {
  const [, kind, problem, solver] = /^#(problem|case)-(\d+)(?:-(\d+))?$/.exec(location.hash) ?? [];
  if (!kind || !(Number(problem) in run.problems)) return;
  open.problem = Number(problem);
  open.solver = kind === "case" && Number(solver) in run.solvers ? Number(solver) : null;
  await renderDetail(currentView());
  const target = place(open.solver === null ? "detail" : "case-view");
  target.scrollIntoView();
  place("detail").focus({ preventScroll: true });
}

addEventListener("hashchange", follow);
place("filters").addEventListener("submit", (event) => event.preventDefault());
buildHead();
buildFilters();
await render();
await follow();
window.proxbench = { figures, render }; // the rows behind each chart, for the console
