// The numbers of the page that depend on its filters. Each equals what Python computes from the same part of a run:
// accuracy.py for means, profiles.py for profiles.

// The rows of a table that is stored in columns.
function records(columns) {
  const names = Object.keys(columns);
  return (columns[names[0]] ?? []).map((_, k) => Object.fromEntries(names.map((name) => [name, columns[name][k]])));
}

// The run with its tables as records; `find(problem, solver)` returns a case. Each case has its points and its curve.
function decoded(document) {
  const cases = records(document.cases).map((one) => ({ ...one, points: [], curve: { iteration: [], residual: [] } }));
  for (const point of records(document.points)) cases[point.case].points.push(point);
  for (const curve of records(document.curves)) cases[curve.case].curve = curve;
  const level = new Map(document.accuracies.map((accuracy, k) => [accuracy, k]));
  for (const one of cases) {
    const at = (column) => (accuracy) => one[column][level.get(accuracy)];
    Object.assign(one, { timeTo: (accuracy) => at("seconds")(accuracy) ?? NaN, isExcluded: at("excluded"), claims: at("claimed") });
  }
  const known = new Map(cases.map((one) => [JSON.stringify([one.problem, one.solver]), one]));
  const solvers = document.solvers.map((solver, k) => ({ ...solver, variable: `--solver-${k}` }));
  return { ...document, solvers, cases, find: (problem, solver) => known.get(JSON.stringify([problem.name, solver.name])) };
}

const timeTo = (view, problem, solver) => view.run.find(problem, solver)?.timeTo(view.accuracy) ?? NaN;
const supports = (view, problem, solver) => Boolean(view.run.find(problem, solver)?.supported);
const supported = (view, problems, solvers) =>
  problems.flatMap((problem) => solvers.map((solver) => view.run.find(problem, solver))).filter((one) => one?.supported);
const share = (values, isIn) => (values.length ? values.filter(isIn).length / values.length : NaN);
const mean = (values) => values.reduce((sum, value) => sum + value, 0) / values.length;
const least = (values) => values.reduce((low, value) => (Number.isNaN(value) || low <= value ? low : value), NaN);
const most = (values) => -least(values.map((value) => -value));

// The solvers of a view that use as many threads as the baseline or, without a baseline, the fewest of the view.
// Only their times are compared.
function withThreads(view, baseline = null) {
  const known = view.run.solvers.find(({ name }) => name === baseline);
  const threads = known?.threads ?? Math.min(...view.solvers.map((solver) => solver.threads));
  return view.solvers.filter((solver) => solver.threads === threads);
}

// A note that names the solvers that `withThreads` leaves out; empty if there are none.
function otherThreads(view, baseline = null) {
  const compared = withThreads(view, baseline);
  const names = view.solvers.filter((solver) => !compared.includes(solver)).map(({ name }) => name);
  return names.length ? `Without solvers that use another number of threads: ${names.join(", ")}.` : "";
}

const bestTime = (view, problem) => least(withThreads(view).map((solver) => timeTo(view, problem, solver)));

// Shifted geometric mean; missing times count as the time limit.
function meanTime(run, times) {
  if (!times.length) return NaN;
  const filled = times.map((time) => (Number.isNaN(time) ? run.limit : Math.min(time, run.limit)));
  return Math.exp(mean(filled.map((time) => Math.log(time + run.shift)))) - run.shift;
}

// The view without the problems of which a solver shown has an excluded time.
function comparedView(view) {
  const isExcluded = (problem, solver) => view.run.find(problem, solver)?.isExcluded(view.accuracy);
  return { ...view, problems: view.problems.filter((problem) => !view.solvers.some((solver) => isExcluded(problem, solver))) };
}

// The solvers of a view that support any of its problems, and the problems that all of these support.
function commonView(view) {
  const solvers = view.solvers.filter((solver) => view.problems.some((problem) => supports(view, problem, solver)));
  const isCommon = (problem) => solvers.every((solver) => supports(view, problem, solver));
  return { ...view, solvers, problems: solvers.length ? view.problems.filter(isCommon) : [] };
}

// One row for each solver shown that supports any problem shown.
function summary(view) {
  const { run, accuracy } = view;
  const [common, compared] = [commonView(view), comparedView(view)];
  const isIn = (part, one) => part.problems.some((problem) => problem.name === one.problem);
  const best = new Map(view.problems.map((problem) => [problem.name, bestTime(view, problem)]));
  const [gains, equals] = [speedups(compared), withThreads(view)];
  return common.solvers.map((solver) => {
    const cases = supported(view, view.problems, [solver]);
    const times = (chosen) => cases.filter(chosen).map((one) => one.timeTo(accuracy));
    const meanOf = (of, chosen) => {
      const included = times((one) => of(one) && chosen(one));
      return { seconds: meanTime(run.run, included), count: included.length, total: times(of).length };
    };
    const own = gains.filter((row) => row.solver === solver.name).map((row) => Math.log(row.speedup));
    return {
      solver,
      problems: cases.length,
      claimed: cases.filter((one) => one.claims(accuracy)).length,
      confirmed: times((one) => !Number.isNaN(one.timeTo(accuracy))).length,
      mean: meanOf((one) => isIn(common, one), (one) => isIn(compared, one)),
      ownMean: meanOf(() => true, (one) => !one.isExcluded(accuracy)),
      fastest: equals.includes(solver)
        ? cases.filter((one) => isIn(compared, one) && one.timeTo(accuracy) === best.get(one.problem)).length
        : NaN,
      speedup: own.length ? Math.exp(mean(own)) : NaN,
      compared: own.length,
      wrong: cases.flatMap((one) => one.points).filter((point) => point.outcome === "wrong").length,
    };
  });
}

// The part of a view that profiles cover, with a text for a note and a title for an axis.
function profileView(view, isCommon) {
  const own = isCommon ? commonView(view) : view;
  const plural = (count, noun) => `${count} ${noun}${count === 1 ? "" : "s"}`;
  const all = plural(view.problems.length, "problem");
  if (isCommon && own.problems.length) {
    const without = view.solvers.length - own.solvers.length;
    const left = without ? `; ${plural(without, "solver")} without a supported problem left out` : "";
    return {
      ...own,
      over: `over the ${own.problems.length} of ${all} that all ${own.solvers.length} solvers support${left}`,
      axis: `share of ${plural(own.problems.length, "common problem")}`,
    };
  }
  const none = isCommon && view.problems.length ? "no problem is supported by all solvers: " : "";
  return { ...view, over: `${none}over all ${all}; unsupported ones count as not solved`, axis: `share of ${all}` };
}

// Corners of the steps by which the share of values at most x grows with x, for each solver.
function steps(view, values, column, first, last) {
  return values.flatMap((own, k) => {
    const solved = own.filter((value) => !Number.isNaN(value)).sort((a, b) => a - b);
    const corners = [...new Set([first, ...solved, last])].sort((a, b) => a - b);
    let below = 0;
    return corners.map((at) => {
      while (below < solved.length && solved[below] <= at) below += 1;
      return { solver: view.solvers[k].name, [column]: at, share: below / own.length };
    });
  });
}

const times = (view) => view.solvers.map((solver) => view.problems.map((problem) => timeTo(view, problem, solver)));

function performanceProfile(view) {
  const compared = { ...view, solvers: withThreads(view) };
  const best = view.problems.map((problem) => bestTime(view, problem));
  const ratios = times(compared).map((own) => own.map((time, k) => time / best[k]));
  return steps(compared, ratios, "ratio", 1, view.run.padding * most([1, ...ratios.flat()]));
}

function dataProfile(view) {
  const seconds = times(view);
  const first = least(seconds.flat());
  const last = most([view.run.budgets.at(-1), ...seconds.flat().map((time) => view.run.padding * time)]);
  return steps(view, seconds, "seconds", Number.isNaN(first) ? view.run.budgets[0] : first, last);
}

function accuracyProfile(view) {
  return view.solvers.flatMap((solver) => {
    const reached = view.problems.map((problem) => view.run.find(problem, solver)?.residual ?? NaN);
    return view.run.residuals.map((residual) =>
      ({ solver: solver.name, residual, share: share(reached, (value) => value <= residual) }));
  });
}

// Problems solved within each budget of time, one row for each solver.
function budgets(view) {
  return times(view).map((own, k) => ({
    solver: view.solvers[k],
    solved: view.run.budgets.map((budget) => own.filter((time) => time <= budget).length),
    problems: own.length,
  }));
}

// The time of the baseline over that of each other solver shown in as many threads, on problems that both solve.
function speedups(view) {
  const baseline = { name: view.baseline };
  return withThreads(view, view.baseline).filter((solver) => solver.name !== view.baseline).flatMap((solver) =>
    view.problems.map((problem) => ({
      solver: solver.name,
      problem: problem.name,
      speedup: timeTo(view, problem, baseline) / timeTo(view, problem, solver),
    })).filter((row) => !Number.isNaN(row.speedup)));
}

// The parts of a view by family, each a view.
function byFamily(view) {
  const families = [...new Set(view.problems.map((problem) => problem.family))];
  return families.map((family) => ({ ...view, family, problems: view.problems.filter((problem) => problem.family === family) }));
}
