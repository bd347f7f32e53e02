// The numbers of the page: which problems and solvers are shown, and what follows for them. Equal to what the tables of
// proxbench compute from the same part of a run.

const COUNTS = 1;
const CLAIMS = 2;
const EXCLUDED = 4;
const ROOM = 1.1; // of the last corner of a profile to the largest value
const POINT = ["tolerance", "outcome", "reason", "marks", "iterations", "residual", "own", "prepare", "seconds", "low", "high"];

// The run with its cases as objects, and `at(problem, solver)` to find one.
function decoded(run) {
  const names = Object.keys(run.cases);
  const cases = run.cases.problem.map((_, k) => Object.fromEntries(names.map((name) => [name, run.cases[name][k]])));
  const found = new Map();
  for (const one of cases) {
    const columns = one.points;
    one.points = columns[0].map((_, k) => Object.fromEntries(POINT.map((name, column) => [name, columns[column][k]])));
    for (const point of one.points) {
      point.tolerance = run.tolerances[point.tolerance];
      point.outcome = run.outcomes[point.outcome];
    }
    found.set(one.problem * run.solvers.length + one.solver, one);
  }
  return { ...run, cases, at: (problem, solver) => found.get(problem * run.solvers.length + solver) };
}

const reaches = (point, accuracy) => Boolean(point.marks & COUNTS) && point.residual !== null && point.residual <= accuracy;

// The least time of a case to an accuracy [s]; NaN if it is not reached.
function timeTo(one, accuracy) {
  let least = NaN;
  for (const point of one?.points ?? []) {
    if (reaches(point, accuracy) && point.seconds !== null && !(least <= point.seconds)) least = point.seconds;
  }
  return least;
}

// Whether that time is of excluded rounds alone, so that it takes part in no comparison.
function isExcluded(one, accuracy) {
  const least = timeTo(one, accuracy);
  const found = one?.points.find((point) => reaches(point, accuracy) && point.seconds === least);
  return Boolean(found && found.marks & EXCLUDED);
}

// The view without the problems of which a solver shown has an excluded time.
function comparedView(view) {
  const isCompared = (problem) => !view.solvers.some((solver) => isExcluded(view.run.at(problem, solver), view.accuracy));
  return { ...view, problems: view.problems.filter(isCompared) };
}

// The least residual of a case that counts; NaN without one.
function bestResidual(one) {
  let least = NaN;
  for (const point of one?.points ?? []) {
    if (reaches(point, Infinity) && point.seconds !== null && !(least <= point.residual)) least = point.residual;
  }
  return least;
}

const claims = (one, accuracy) => one.points.some((point) => point.marks & CLAIMS && point.tolerance <= accuracy * (1 + 1e-9));
const matrix = (view, value) => view.solvers.map((solver) => view.problems.map((problem) => value(view.run.at(problem, solver))));
const times = (view, accuracy) => matrix(view, (one) => timeTo(one, accuracy));
const share = (values, isIn) => (values.length ? values.filter(isIn).length / values.length : NaN);
const mean = (values) => values.reduce((sum, value) => sum + value, 0) / values.length;

function meanTime(run, values) {
  if (!values.length) return NaN;
  const filled = values.map((time) => (Number.isNaN(time) ? run.limit : Math.min(time, run.limit)));
  return Math.exp(mean(filled.map((time) => Math.log(time + run.shift)))) - run.shift;
}

// One row a solver shown that supports any problem shown.
function summary(view) {
  const { run, accuracy } = view;
  const tried = view.solvers
    .map((solver) => ({ solver, cases: view.problems.map((problem) => run.at(problem, solver)).filter((one) => one?.supported) }))
    .filter((row) => row.cases.length);
  const supporters = new Map();
  for (const { cases } of tried) for (const one of cases) supporters.set(one.problem, (supporters.get(one.problem) ?? 0) + 1);
  const isCommon = (one) => supporters.get(one.problem) === tried.length;
  const gains = speedups(comparedView(view));
  const compared = new Set(comparedView(view).problems);
  return tried.map(({ solver, cases }) => {
    const seconds = cases.map((one) => timeTo(one, accuracy));
    const own = gains.filter((row) => row.number === solver).map((row) => Math.log(row.speedup));
    return {
      solver,
      problems: cases.length,
      common: cases.filter(isCommon).length,
      says: cases.filter((one) => claims(one, accuracy)).length,
      correct: seconds.filter((time) => !Number.isNaN(time)).length,
      mean: meanTime(run.run, seconds.filter((_, k) => isCommon(cases[k]) && compared.has(cases[k].problem))),
      ownMean: meanTime(run.run, seconds.filter((_, k) => !isExcluded(cases[k], accuracy))),
      fastest: cases.filter((one, k) => compared.has(one.problem) && seconds[k] === virtualBest(view, one.problem)).length,
      speedup: own.length ? Math.exp(mean(own)) : NaN,
      compared: own.length,
      wrong: cases.flatMap((one) => one.points).filter((point) => point.outcome === "wrong").length,
    };
  });
}

const virtualBest = (view, problem) => least(view.solvers.map((solver) => timeTo(view.run.at(problem, solver), view.accuracy)));
const least = (values) => values.reduce((low, value) => (Number.isNaN(value) || low <= value ? low : value), NaN);
const most = (values) => -least(values.map((value) => -value));

// Solvers of a view that support any of its problems, and the problems that all of these support.
function commonView(view) {
  const supports = (problem, solver) => Boolean(view.run.at(problem, solver)?.supported);
  const solvers = view.solvers.filter((solver) => view.problems.some((problem) => supports(problem, solver)));
  const problems = solvers.length ? view.problems.filter((problem) => solvers.every((solver) => supports(problem, solver))) : [];
  return { ...view, problems, solvers };
}

// The part of a view that profiles are over, and what their shares are of, in a note and on an axis.
function profileView(view, isCommon) {
  const own = isCommon ? commonView(view) : view;
  const plural = (count, noun) => `${count} ${noun}${count === 1 ? "" : "s"}`;
  const all = plural(view.problems.length, "problem");
  if (isCommon && own.problems.length) {
    const without = view.solvers.length - own.solvers.length;
    const left = without ? `; ${plural(without, "solver")} that support none left out` : "";
    return {
      ...own,
      over: `over the ${own.problems.length} of ${all} that ${own.solvers.length} solvers all support${left}`,
      axis: `share of ${plural(own.problems.length, "common problem")}`,
    };
  }
  const none = isCommon && view.problems.length ? "no problem is supported by all solvers: " : "";
  return { ...view, over: `${none}over all ${all}, unsupported ones counted as not solved`, axis: `share of ${all}` };
}

// Corners of the stairs by which the share of values at most x grows with x, one staircase a solver.
function stairs(view, values, column, first, last) {
  return values.flatMap((own, k) => {
    const solved = own.filter((value) => !Number.isNaN(value)).sort((a, b) => a - b);
    const corners = [...new Set([first, ...solved, last])].sort((a, b) => a - b);
    let below = 0;
    return corners.map((at) => {
      while (below < solved.length && solved[below] <= at) below += 1;
      return { solver: view.run.solvers[view.solvers[k]].name, [column]: at, share: below / own.length };
    });
  });
}

function performanceProfile(view) {
  const best = view.problems.map((problem) => virtualBest(view, problem));
  const ratios = times(view, view.accuracy).map((own) => own.map((time, k) => time / best[k]));
  return stairs(view, ratios, "ratio", 1, ROOM * most([1, ...ratios.flat()]));
}

function dataProfile(view) {
  const seconds = times(view, view.accuracy);
  const first = least(seconds.flat());
  const last = most([view.run.budgets.at(-1), ...seconds.flat().map((time) => ROOM * time)]);
  return stairs(view, seconds, "seconds", Number.isNaN(first) ? view.run.budgets[0] : first, last);
}

function accuracyProfile(view) {
  return matrix(view, bestResidual).flatMap((own, k) =>
    view.run.residuals.map((residual) => ({
      solver: view.run.solvers[view.solvers[k]].name,
      residual,
      share: share(own, (value) => value <= residual),
    })));
}

// Solved within each budget of time, one row a solver.
function budgets(view) {
  return times(view, view.accuracy).map((own, k) => ({
    solver: view.solvers[k],
    solved: view.run.budgets.map((budget) => own.filter((time) => time <= budget).length),
    problems: own.length,
  }));
}

// The time of the baseline over that of each other solver shown, on problems that both solve.
function speedups(view) {
  const { run, accuracy } = view;
  return view.solvers.filter((solver) => solver !== view.baseline).flatMap((solver) =>
    view.problems.map((problem) => ({
      number: solver,
      solver: run.solvers[solver].name,
      problem: run.problems[problem].name,
      speedup: timeTo(run.at(problem, view.baseline), accuracy) / timeTo(run.at(problem, solver), accuracy),
    })).filter((row) => !Number.isNaN(row.speedup)));
}

// The parts of a view by family, each a view.
function byFamily(view) {
  const families = [...new Set(view.problems.map((problem) => view.run.problems[problem].family))];
  return families.map((family) => ({
    family,
    ...view,
    problems: view.problems.filter((problem) => view.run.problems[problem].family === family),
  }));
}
