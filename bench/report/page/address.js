// The address of a view: filters and names in its fragment, so that a copied address opens the same view.

const FILTERS = { family: "problems", law: "problems", model: "solvers", solver: "solvers" };
const filterOf = { family: (one) => one.family, law: (one) => one.law, model: (one) => one.model, solver: (one) => one.name };
const filterValues = (run, name) => [...new Set(run[FILTERS[name]].map(filterOf[name]))];

function defaults(run) {
  return {
    hidden: Object.fromEntries(Object.keys(FILTERS).map((name) => [name, new Set()])),
    fewest: 0, most: Infinity, name: "", accuracy: run.accuracy, baseline: run.baseline, isSplit: false, isCommon: true,
    problem: run.open, case: null,
  };
}

// The address of a state, without its default values.
function addressOf(run, state) {
  const [usual, words] = [defaults(run), new URLSearchParams()];
  for (const name of ["accuracy", "baseline", "name", "fewest", "most", "problem", "case"]) {
    if (state[name] !== usual[name] && state[name] !== null) words.set(name, state[name]);
  }
  if (!state.isCommon) words.set("profiles", "all");
  if (state.isSplit) words.set("split", "family");
  for (const [name, values] of Object.entries(state.hidden)) for (const value of values) words.append(`without-${name}`, value);
  return `#${words.size ? words : "all="}`;
}

// The state of an address, or null for the address of a section; names that are not in the run are ignored.
function stateOf(run, address) {
  if (!address.includes("=")) return null;
  const [state, words] = [defaults(run), new URLSearchParams(address.slice(1))];
  const take = (name, read, isKnown) => {
    const value = words.has(name) ? read(words.get(name)) : undefined;
    if (value !== undefined && isKnown(value)) state[name] = value;
  };
  const isNumber = (value) => Number.isFinite(value) && value >= 0;
  take("accuracy", Number, (value) => run.accuracies.includes(value));
  take("fewest", Number, isNumber);
  take("most", Number, isNumber);
  take("name", String, () => true);
  for (const [name, table] of [["baseline", "solvers"], ["problem", "problems"], ["case", "solvers"]]) {
    take(name, String, (value) => run[table].some((one) => one.name === value));
  }
  state.isCommon = words.get("profiles") !== "all";
  state.isSplit = words.get("split") === "family";
  for (const name of Object.keys(FILTERS)) {
    const known = new Set(filterValues(run, name));
    state.hidden[name] = new Set(words.getAll(`without-${name}`).filter((value) => known.has(value)));
  }
  return state;
}

// The part of the run that a state shows.
function viewOf(run, state) {
  const isShown = (one, table) =>
    Object.keys(FILTERS).every((name) => FILTERS[name] !== table || !state.hidden[name].has(filterOf[name](one)));
  return {
    run,
    problems: run.problems.filter((one) => isShown(one, "problems") && one.contacts >= state.fewest &&
      one.contacts <= state.most && one.name.toLowerCase().includes(state.name.toLowerCase())),
    solvers: run.solvers.filter((one) => isShown(one, "solvers")),
    accuracy: state.accuracy,
    baseline: state.baseline,
    isCommon: state.isCommon,
  };
}
