// The tables of a view, and the panels of one problem and of one case.

const solverCell = (solver) => ({ node: element("span", { class: "solver" }, swatch(solver), element("span", {}, solver.name)), value: solver.name });
const linkCell = (address, text) => ({ node: element("a", { href: address }, text), value: text });
const problemLink = (view, problem) => linkCell(view.linkTo({ problem }), problem);
const caseLink = (view, one, text) => linkCell(view.linkTo({ problem: one.problem, case: one.solver }), text);
const timeCell = (seconds, excluded = false) => ({ text: duration(seconds) + (excluded ? "*" : ""), value: seconds });
// A mean time, with the number of problems if excluded times reduce it.
const meanCell = ({ seconds, count, total }) => ({ text: duration(seconds) + (count && count < total ? ` (${count})` : ""), value: seconds });
const counts = (part, all) => ({ text: `${part}/${all}`, value: all ? part / all : NaN, share: all ? part / all : 0 });
const numeric = (name) => ({ name, numeric: true });

function summaryTable(view) {
  const columns = [{ name: "solver" }, { name: "model" }, ...["claimed", "confirmed", "mean", "own mean", "fastest", "speed-up", "wrong"].map(numeric)];
  return table(columns, summary(view).map((row) => [
    solverCell(row.solver),
    row.solver.model,
    { text: `${row.claimed}/${row.problems}`, value: row.claimed / row.problems },
    counts(row.confirmed, row.problems),
    meanCell(row.mean),
    meanCell(row.ownMean),
    { text: digits(row.fastest, 12), value: row.fastest },
    row.solver.name === view.baseline
      ? { text: "baseline", value: 1 }
      : { text: row.compared ? `${digits(row.speedup, 3)} (${row.compared})` : NONE, value: row.speedup },
    { text: row.wrong, value: row.wrong },
  ]), "Summary of solvers");
}

function budgetsTable(view) {
  const columns = [{ name: "solver" }, ...view.run.budgets.map((budget) => numeric(`within ${duration(budget)}`))];
  const rows = budgets(profileView(comparedView(view), view.isCommon)).map(({ solver, solved, problems }) =>
    [solverCell(solver), ...solved.map((number) => counts(number, problems))]);
  return table(columns, rows, "Problems solved within a time");
}

function familiesTable(view) {
  const parts = byFamily(view);
  const columns = [{ name: "solver" }, ...parts.map(({ family }) => numeric(family))];
  const rows = view.solvers.map((solver) => [
    solverCell(solver),
    ...parts.map(({ problems }) => {
      const cases = supported(view, problems, [solver]);
      const solved = cases.filter((one) => !Number.isNaN(one.timeTo(view.accuracy))).length;
      return cases.length ? counts(solved, cases.length) : { text: NONE, value: NaN };
    }),
  ]);
  return table(columns, rows, "Problems solved by family");
}

function problemsTable(view) {
  const columns = ["problem", "family", "law"].map((name) => ({ name }));
  columns.push(...["contacts", "rows", "solved"].map(numeric), { name: "fastest" }, ...["time", "residual"].map(numeric));
  const rows = view.problems.map((problem) => {
    const cases = supported(view, [problem], view.solvers);
    const solved = cases.filter((one) => !Number.isNaN(one.timeTo(view.accuracy)));
    const best = bestTime(view, problem);
    const isCompared = comparedView({ ...view, problems: [problem] }).problems.length > 0;
    const isEqual = (one) => withThreads(view).some(({ name }) => name === one.solver);
    const fastest = isCompared ? solved.find((one) => isEqual(one) && one.timeTo(view.accuracy) === best) : undefined;
    const residual = least(cases.map((one) => one.residual ?? NaN));
    return [
      problemLink(view, problem.name), problem.family, problem.law,
      { text: problem.contacts, value: problem.contacts }, { text: problem.rows, value: problem.rows },
      counts(solved.length, cases.length),
      fastest ? caseLink(view, fastest, fastest.solver) : { text: NONE, value: null },
      timeCell(best, !isCompared), { text: power(residual), value: residual },
    ];
  });
  return table(columns, rows, "Problems");
}

const MAX_ROWS = 300;
const casesOf = (view) =>
  view.problems.flatMap((problem) => view.solvers.map((solver) => view.run.find(problem, solver))).filter(Boolean);

function failuresTable(view, all = false) {
  const failed = casesOf(view).filter(({ outcome }) => outcome !== "solved" && outcome !== "unsupported");
  const shown = all ? failed : failed.slice(0, MAX_ROWS);
  const columns = ["problem", "solver", "outcome", "reason"].map((name) => ({ name }));
  const failures = table(columns, shown.map((one) => [
    problemLink(view, one.problem), caseLink(view, one, one.solver), one.outcome, one.reason,
  ]), "Cases that are not solved");
  if (shown.length === failed.length) return failures;
  const more = () => fill("failures-table", failuresTable(view, true));
  return element("div", {}, failures, element("button", { type: "button", onclick: more }, `Show all ${failed.length}`));
}

// One row for each solver and reason.
function unsupportedTable(view) {
  const groups = new Map();
  for (const one of casesOf(view).filter(({ outcome }) => outcome === "unsupported")) {
    const key = JSON.stringify([one.solver, one.reason]);
    groups.set(key, [...(groups.get(key) ?? []), one]);
  }
  const columns = [{ name: "solver" }, numeric("number"), { name: "problems" }, { name: "reason" }];
  const rows = [...groups.values()].map((cases) => [
    cases[0].solver, { text: cases.length, value: cases.length }, cases.map(({ problem }) => problem).join(", "), cases[0].reason,
  ]);
  return rows.length ? table(columns, rows, "Cases that are not supported") : element("p", { class: "note" }, "Each solver shown supports each problem shown.");
}

function facts(pairs) {
  const known = pairs.filter(([, value]) => value !== "" && value !== null);
  return element("dl", { class: "facts" }, known.map(([name, value]) => [element("dt", {}, name), element("dd", {}, value)]).flat());
}

const recording = (run, problem) =>
  (problem.recorded
    ? element("a", { href: `${run.run.root}recordings/${problem.file}.rrd` }, `recordings/${problem.file}.rrd`)
    : "none; proxbench record makes one");

// The points and curves of a problem, of the solvers given, as rows of the charts.
function costRows(run, problem, solvers) {
  return solvers.flatMap((solver) => (run.find(problem, solver)?.points ?? [])
    .filter((point) => point.seconds !== null && point.residual !== null)
    .map((point) => ({
      solver: solver.name,
      tolerance: point.tolerance,
      residual: Math.max(point.residual, run.min_residual),
      milliseconds: 1e3 * point.seconds, low: 1e3 * point.low, high: 1e3 * point.high,
      iterations: point.iterations, outcome: point.outcome,
    })));
}

function curveRows(run, problem, solvers) {
  return solvers.flatMap((solver) => {
    const { iteration, residual } = run.find(problem, solver)?.curve ?? { iteration: [], residual: [] };
    return iteration
      .map((number, k) => ({ solver: solver.name, iteration: number, residual: Math.max(residual[k], run.min_residual) }))
      .filter((row) => row.residual <= run.max_residual); // diverging curves are cut, so that others are not flat
  });
}

const costFigure = (id) => figureOf("What accuracy costs",
  "Each curve is a solver, each mark a solve: lower is faster, further to the right is more accurate.", id);
const convergenceFigure = (id) => figureOf("Convergence",
  "Each curve is a solver: the sooner it falls, the fewer iterations it needs.", id);

function problemView(view, problem) {
  const { run } = view;
  const columns = [{ name: "solver" }, ...["time", "over the best", "residual", "iterations"].map(numeric), { name: "outcome" }, { name: "reason" }];
  const isCompared = comparedView({ ...view, problems: [problem] }).problems.length > 0;
  const best = isCompared ? bestTime(view, problem) : NaN;
  const rows = view.solvers.map((solver) => run.find(problem, solver)).filter(Boolean).map((one) => {
    const seconds = one.timeTo(view.accuracy);
    const ratio = withThreads(view).some(({ name }) => name === one.solver) ? seconds / best : NaN;
    return [
      caseLink(view, one, one.solver),
      timeCell(seconds, one.isExcluded(view.accuracy)), { text: digits(ratio, 3), value: ratio },
      { text: power(one.residual ?? NaN), value: one.residual }, { text: one.iterations ?? NONE, value: one.iterations },
      one.outcome, one.reason,
    ];
  });
  return [
    element("h3", {}, problem.name),
    facts([
      ["family", problem.family], ["law", problem.law], ["contacts, rows", `${problem.contacts}, ${problem.rows}`],
      ["digest", problem.digest], ["recording", recording(run, problem)],
    ]),
    costFigure("cost"), convergenceFigure("convergence"),
    element("h4", {}, `Solvers shown, to a residual of ${exact(view.accuracy)}`), table(columns, rows, `Solvers on ${problem.name}`),
  ];
}

function caseView(view, problem, solver, one) {
  const { run } = view;
  const columns = [...["tolerance", "residual", "of its model"].map(numeric), { name: "outcome" },
    ...["iterations", "preparation", "time", "quartiles"].map(numeric), { name: "reason" }];
  const rows = one.points.map((point) => [
    { text: exact(point.tolerance), value: point.tolerance }, { text: power(point.residual ?? NaN, 3), value: point.residual },
    { text: power(point.model_residual ?? NaN, 3), value: point.model_residual }, point.outcome,
    { text: point.iterations ?? NONE, value: point.iterations }, timeCell(point.prepare ?? NaN), timeCell(point.seconds ?? NaN, point.excluded),
    { text: point.low === null ? NONE : `${duration(point.low)} to ${duration(point.high)}`, value: point.low },
    point.reason,
  ]);
  const printed = [["Traceback", one.traceback], ["Standard error", one.stderr]].filter(([, text]) => text);
  const file = `cases/${problem.file}--${solver.file}.json`;
  return [
    element("h3", {}, swatch(solver), ` ${solver.name} on ${problem.name}`),
    facts([
      ["outcome", one.outcome], ["reason", one.reason], ["model", solver.model], ["digest of the problem", problem.digest],
      ["wall time of the case", duration(one.wall)], ["peak memory", `${digits(one.memory / 2 ** 20, 3)} MiB`],
      ["stored in", element("a", { href: `${run.run.root}${file}` }, file)], ["recording", recording(run, problem)],
    ]),
    element("h4", {}, "Command"), element("pre", { tabindex: 0 }, ["proxbench run", problem.option, solver.option, run.run.protocol].join(" \\\n  ")),
    costFigure("own-cost"), convergenceFigure("own-convergence"),
    element("h4", {}, "Tolerances"),
    table(columns, rows, `Tolerances of ${solver.name} on ${problem.name}`),
    ...printed.flatMap(([name, text]) => [element("h4", {}, name), element("pre", { tabindex: 0 }, text)]),
  ];
}

// What a warm start is worth: a row for each family, solver and tolerance.
function startsTable(rows) {
  const heads = ["cold solved", "warm solved", "cold iterations", "warm iterations", "cold time", "warm time", "gain", "slower"];
  const columns = [{ name: "family" }, { name: "solver" }, ...["tolerance", ...heads].map(numeric)];
  const rounded = (value, count) => ({ text: digits(value ?? NaN, count), value });
  return table(columns, rows.map((row) => [
    row.family,
    row.solver,
    { text: exact(row.tolerance), value: row.tolerance },
    counts(row.cold_solved, row.problems),
    counts(row.warm_solved, row.problems),
    ...[row.cold_iterations, row.warm_iterations].map((value) => rounded(value, 3)),
    ...[row.cold_seconds, row.warm_seconds].map((value) => timeCell(value)),
    rounded(row.gain, 2),
    counts(row.slower, row.timed),
  ]), "What a warm start is worth");
}
