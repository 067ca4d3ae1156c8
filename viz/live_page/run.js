// A motion that is computed as it is watched: its clock, its step, what is set, and its state as a text for a link.

const MOST_STEPS = 4000; // in a frame, of both runs together: what is left is slower than real time
const NOTHING = 1e-14; // of the largest meter of its group on the way, below which one is shown as 0
const AHEAD = 0.25; // s that the error ahead looks at

/** A run of a machine. */
function liveRun(machine, data) {
  let sizes = new Map();
  const state = { dt: data.dt, method: "rk4", time: 0, owed: 0, slow: false };

  function reset() {
    data.inputs.forEach(({ value }, i) => { machine.run[i] = value; });
    Object.assign(state, { dt: data.dt, method: "rk4", time: 0, owed: 0, slow: false });
    together();
  }
  /** The reference starts here. */
  function together() {
    machine.fine.set(machine.run);
    machine.forget();
    sizes = machine.sizesAhead(state.method, state.dt);
  }
  /** An input gets a value, and the reference starts anew. */
  function set(i, value) {
    if (!Number.isFinite(value)) return false;
    machine.run[i] = value;
    together();
    return true;
  }
  /** Real time goes by. Returns the steps made. */
  function advance(seconds) {
    state.owed += Math.max(0, seconds); // a frame may begin before the moment that asked for it
    const due = Math.floor(state.owed / state.dt), k = machine.finer(state.dt);
    const count = Math.min(due, Math.max(1, Math.floor(MOST_STEPS / (k + 1))));
    state.slow = count < due;
    state.owed = state.slow ? 0 : state.owed - due * state.dt;
    steps(count);
    return count;
  }
  function steps(count) {
    machine.step(machine.run, state.method, state.dt, count);
    const k = machine.finer(state.dt);
    machine.step(machine.fine, "dopri5", state.dt / k, count * k);
    state.time += count * state.dt;
  }
  /** What is shown now, and the errors. */
  function now() {
    const values = machine.look(machine.run), reference = machine.look(machine.fine);
    machine.larger(sizes, values);
    return {
      values, reference, meters: data.meters.map(({ group }, k) => (Math.abs(values[k]) < NOTHING * sizes.get(group) ? 0 : values[k])), since: machine.apart(machine.run, machine.fine),
      ahead: machine.errorAhead(state.method, state.dt, AHEAD), energyOff: data.energy < 0 ? 0 : values[data.energy] - reference[data.energy],
      finite: machine.run.subarray(0, data.states).every(Number.isFinite),
    };
  }
  /** All that is set, as a text for the fragment of a link. */
  function link() {
    const values = Object.fromEntries(data.inputs.map(({ name }, i) => [name, machine.run[i]]));
    return encodeURIComponent(JSON.stringify({ dt: state.dt, method: state.method, time: state.time, values }));
  }
  /** Sets what a link says; what it says wrongly stays as it is. Returns whether it could be read. */
  function open(text) {
    let found;
    try {
      found = JSON.parse(decodeURIComponent(text));
    } catch {
      return false;
    }
    if (found === null || typeof found !== "object") return false;
    if (Number.isFinite(found.dt) && found.dt > 0) state.dt = found.dt;
    if (data.methods.includes(found.method)) state.method = found.method;
    if (Number.isFinite(found.time)) state.time = found.time;
    data.inputs.forEach(({ name }, i) => { if (Number.isFinite(found.values?.[name])) machine.run[i] = found.values[name]; });
    state.owed = 0;
    together();
    return true;
  }
  reset();
  return { state, reset, set, advance, steps, now, link, open };
}
