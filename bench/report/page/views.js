// What the page shows of a view: its tables, and the panels of one problem and of one case.

const solverCell = (solver) => ({ node: element("span", { class: "solver" }, swatch(solver), element("span", {}, solver.name)), value: solver.name });
const problemLink = (run, problem) =>
  ({ node: element("a", { href: `#problem-${problem}` }, run.problems[problem].name), value: run.problems[problem].name });
const caseLink = (run, one, text) =>
  ({ node: element("a", { href: `#case-${one.problem}-${one.solver}` }, text), value: text });
const timeCell = (seconds, excluded = false) => ({ text: duration(seconds) + (excluded ? "*" : ""), value: seconds });
const counts = (part, all) => ({ text: `${part}/${all}`, value: all ? part / all : NaN, share: all ? part / all : 0 });
const numeric = (name) => ({ name, numeric: true });

function summaryTable(view) {
  const rows = summary(view);
  const columns = [{ name: "solver" }, { name: "model" }, ...["says", "true", "mean", "own mean", "fastest", "speed-up", "wrong"].map(numeric)];
  return table(columns, rows.map((row) => [
    solverCell(view.run.solvers[row.solver]),
    view.run.solvers[row.solver].model,
    { text: `${row.says}/${row.problems}`, value: row.says / row.problems },
    counts(row.correct, row.problems),
    timeCell(row.mean),
    timeCell(row.ownMean),
    { text: row.fastest, value: row.fastest },
    row.solver === view.baseline
      ? { text: "baseline", value: 1 }
      : { text: row.compared ? `${digits(row.speedup, 3)} (${row.compared})` : NONE, value: row.speedup },
    { text: row.wrong, value: row.wrong },
  ]), "Summary of solvers");
}

function budgetsTable(view) {
  const columns = [{ name: "solver" }, ...view.run.budgets.map((budget) => numeric(`within ${duration(budget)}`))];
  const rows = budgets(profileView(comparedView(view), view.isCommon)).map(({ solver, solved, problems }) =>
    [solverCell(view.run.solvers[solver]), ...solved.map((number) => counts(number, problems))]);
  return table(columns, rows, "Problems solved within a time");
}

function familiesTable(view) {
  const parts = byFamily(view);
  const columns = [{ name: "solver" }, ...parts.map(({ family }) => numeric(family))];
  const rows = view.solvers.map((solver) => [
    solverCell(view.run.solvers[solver]),
    ...parts.map(({ problems }) => {
      const tried = problems.map((problem) => view.run.at(problem, solver)).filter((one) => one?.supported);
      const solved = tried.filter((one) => !Number.isNaN(timeTo(one, view.accuracy))).length;
      return tried.length ? counts(solved, tried.length) : { text: NONE, value: NaN };
    }),
  ]);
  return table(columns, rows, "Problems solved by family");
}

function problemsTable(view) {
  const { run } = view;
  const columns = ["problem", "family", "law"].map((name) => ({ name }));
  columns.push(...["contacts", "rows", "solved"].map(numeric), { name: "fastest" }, ...["time", "residual"].map(numeric));
  const rows = view.problems.map((problem) => {
    const about = run.problems[problem];
    const tried = view.solvers.map((solver) => run.at(problem, solver)).filter((one) => one?.supported);
    const seconds = tried.map((one) => timeTo(one, view.accuracy));
    const best = virtualBest(view, problem);
    const isCompared = comparedView({ ...view, problems: [problem] }).problems.length > 0;
    const fastest = isCompared ? tried[seconds.indexOf(best)] : undefined;
    const residual = least(tried.map(bestResidual));
    return [
      problemLink(run, problem), about.family, about.law,
      { text: about.contacts, value: about.contacts }, { text: about.rows, value: about.rows },
      counts(seconds.filter((time) => !Number.isNaN(time)).length, tried.length),
      fastest ? caseLink(run, fastest, run.solvers[fastest.solver].name) : { text: NONE, value: null },
      timeCell(best, !isCompared), { text: power(residual), value: residual },
    ];
  });
  return table(columns, rows, "Problems");
}

const MOST_ROWS = 300;

function endingsTable(view, all = false) {
  const { run } = view;
  const ended = view.problems.flatMap((problem) => view.solvers.map((solver) => run.at(problem, solver)))
    .filter((one) => one && one.outcome !== "solved");
  const shown = all ? ended : ended.slice(0, MOST_ROWS);
  const columns = ["problem", "solver", "ended", "why"].map((name) => ({ name }));
  const made = table(columns, shown.map((one) => [
    problemLink(run, one.problem), caseLink(run, one, run.solvers[one.solver].name), one.outcome, run.texts[one.reason],
  ]), "Cases that are not solved");
  if (shown.length === ended.length) return made;
  const more = () => fill("endings-table", endingsTable(view, true));
  return element("div", {}, made, element("button", { type: "button", onclick: more }, `Show all ${ended.length}`));
}

function facts(pairs) {
  const known = pairs.filter(([, value]) => value !== "" && value !== null);
  return element("dl", { class: "facts" }, known.map(([name, value]) => [element("dt", {}, name), element("dd", {}, value)]).flat());
}

const recording = (run, problem) => {
  const about = run.problems[problem];
  if (!about.recorded) return "none; proxbench record makes one";
  return element("a", { href: `${run.run.root}recordings/${about.file}.rrd` }, `recordings/${about.file}.rrd`);
};

// The points and curves of a problem, of the solvers given, as rows of the charts.
function costRows(run, problem, solvers) {
  return solvers.flatMap((solver) => (run.at(problem, solver)?.points ?? [])
    .filter((point) => point.seconds !== null && point.residual !== null)
    .map((point) => ({
      solver: run.solvers[solver].name,
      tolerance: point.tolerance,
      residual: Math.max(point.residual, 1e-16),
      milliseconds: 1e3 * point.seconds, low: 1e3 * point.low, high: 1e3 * point.high,
      iterations: point.iterations, outcome: point.outcome,
    })));
}

function curveRows(run, problem, solvers) {
  return solvers.flatMap((solver) => {
    const [iterations, residuals] = run.at(problem, solver)?.curve ?? [[], []];
    return iterations.map((iteration, k) =>
      ({ solver: run.solvers[solver].name, iteration, residual: Math.max(residuals[k], 1e-16) }))
      .filter((row) => row.residual <= 1e3); // diverging curves leave the chart, so that the others keep their shape
  });
}

function problemView(view, problem) {
  const { run } = view;
  const about = run.problems[problem];
  const columns = [{ name: "solver" }, ...["time", "over the best", "residual", "iterations"].map(numeric), { name: "ended" }, { name: "why" }];
  const isCompared = comparedView({ ...view, problems: [problem] }).problems.length > 0;
  const best = isCompared ? virtualBest(view, problem) : NaN;
  const rows = view.solvers.map((solver) => run.at(problem, solver)).filter(Boolean).map((one) => {
    const seconds = timeTo(one, view.accuracy);
    const residual = bestResidual(one);
    const finest = one.points.find((point) => reaches(point, residual));
    return [
      { ...caseLink(run, one, run.solvers[one.solver].name), value: run.solvers[one.solver].name },
      timeCell(seconds, isExcluded(one, view.accuracy)), { text: digits(seconds / best, 3), value: seconds / best },
      { text: power(residual), value: residual }, { text: finest?.iterations ?? NONE, value: finest?.iterations ?? NaN },
      one.outcome, run.texts[one.reason],
    ];
  });
  return [
    element("h3", {}, about.name),
    facts([
      ["family", about.family], ["law", about.law], ["contacts, rows", `${about.contacts}, ${about.rows}`],
      ["digest", about.digest], ["recording", recording(run, problem)],
    ]),
    element("h4", {}, "What accuracy costs"), element("div", { id: "cost", class: "figure" }),
    element("h4", {}, "How the iterations converge"), element("div", { id: "convergence", class: "figure" }),
    element("h4", {}, `Solvers shown, to a residual of ${power(view.accuracy)}`), table(columns, rows, `Solvers on ${about.name}`),
  ];
}

function caseView(view, one) {
  const { run } = view;
  const [about, solver] = [run.problems[one.problem], run.solvers[one.solver]];
  const columns = [...["tolerance", "residual", "of its model"].map(numeric), { name: "ended" },
    ...["iterations", "preparing", "time", "quartiles"].map(numeric), { name: "why" }];
  const rows = one.points.map((point) => [
    { text: power(point.tolerance), value: point.tolerance }, { text: power(point.residual, 3), value: point.residual },
    { text: power(point.own, 3), value: point.own }, point.outcome,
    { text: point.iterations ?? NONE, value: point.iterations }, timeCell(point.prepare ?? NaN), timeCell(point.seconds ?? NaN, point.marks & EXCLUDED),
    { text: point.low === null ? NONE : `${duration(point.low)} to ${duration(point.high)}`, value: point.low },
    run.texts[point.reason],
  ]);
  const printed = [["traceback", run.texts[one.traceback]], ["standard error", run.texts[one.stderr]]].filter(([, text]) => text);
  const file = `cases/${about.file}--${solver.file}.json`;
  return [
    element("h3", {}, swatch(solver), ` ${solver.name} on ${about.name}`),
    facts([
      ["ended", one.outcome], ["why", run.texts[one.reason]], ["model", solver.model], ["digest of the problem", about.digest],
      ["wall time of the case", duration(one.wall)], ["peak memory", `${digits(one.memory / 2 ** 20, 3)} MiB`],
      ["stored in", element("a", { href: `${run.run.root}${file}` }, file)], ["recording", recording(run, one.problem)],
    ]),
    element("h4", {}, "Command"), element("pre", { tabindex: 0 }, ["proxbench run", about.option, solver.option, run.run.protocol].join(" \\\n  ")),
    element("h4", {}, "What accuracy costs"), element("div", { id: "own-cost", class: "figure" }),
    element("h4", {}, "How the iterations converge"), element("div", { id: "own-convergence", class: "figure" }),
    element("h4", {}, "Tolerances"),
    table(columns, rows, `Ladder of ${solver.name} on ${about.name}`),
    ...printed.flatMap(([name, text]) => [element("h4", {}, name), element("pre", { tabindex: 0 }, text)]),
  ];
}
