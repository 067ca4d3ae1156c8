// The lesson: one screen at a time, a guess on each, a score; all of it in the address, nothing stored.

const LESSON = JSON.parse(document.getElementById("data").textContent);
const SCREENS = [...document.querySelectorAll(".screen")];
const STATE = { current: 0, guesses: SCREENS.map(() => null) };

/** The state as the address has it, #3;1-0---: the screen, and a guess or a dash for each. */
const written = () => `#${STATE.current + 1};${STATE.guesses.map((guess) => guess ?? "-").join("")}`;
function read(text) {
  const match = /^#(\d+)(?:;([-0-9]*))?$/.exec(text);
  if (!match) return;
  STATE.current = Math.min(Math.max(+match[1] - 1, 0), SCREENS.length - 1);
  STATE.guesses = SCREENS.map((screen, i) => {
    const guess = (match[2] ?? "")[i];
    return guess !== undefined && guess !== "-" && +guess < screen.querySelectorAll(".choice").length ? +guess : null;
  });
}
function score() {
  const made = STATE.guesses.filter((guess) => guess !== null).length;
  return `${STATE.guesses.filter((guess, i) => guess === LESSON.answers[i]).length} of ${made} right`;
}
function show() {
  SCREENS.forEach((screen, i) => {
    const guess = STATE.guesses[i], answer = LESSON.answers[i];
    screen.classList.toggle("current", i === STATE.current);
    [...screen.querySelectorAll(".choice")].forEach((button, k) => {
      button.disabled = guess !== null;
      button.classList.toggle("chosen", guess === k);
      button.classList.toggle("right", guess !== null && k === answer);
      button.classList.toggle("wrong", guess === k && k !== answer);
    });
    screen.querySelector(".verdict").textContent =
      guess === null ? "" : guess === answer ? "Right." : `Not so: ${"ABCDEF"[answer]}. See why.`;
    const link = LINKS[i];
    link.className = guess === null ? "" : guess === answer ? "right" : "wrong";
    if (i === STATE.current) link.setAttribute("aria-current", "step"); else link.removeAttribute("aria-current");
  });
  SCORE.textContent = score();
  play(STATE.current);
  try { history.replaceState(null, "", written()); } catch { /* a frame without an address */ }
}
function go(to) {
  STATE.current = Math.min(Math.max(to, 0), SCREENS.length - 1);
  show();
  window.scrollTo(0, 0);
}
function guess(screen, choice) {
  if (STATE.guesses[screen] !== null || choice >= SCREENS[screen].querySelectorAll(".choice").length) return;
  STATE.guesses[screen] = choice;
  SCREENS[screen].querySelector(".reveal").open = true;
  show();
}
/** What there is to play with, made when its screen is first seen. */
function play(k) {
  const board = SCREENS[k].querySelector(".board"), what = LESSON.plays[k];
  if (what && !board.hasChildNodes()) startPlay(board, { values: LESSON.values, ...what });
}

const NAV = document.querySelector("nav");
const LINKS = SCREENS.map((screen, i) => {
  const link = tag("a", { href: `#${i + 1}`, "aria-label": screen.querySelector("h2").textContent }, String(i + 1));
  link.addEventListener("click", (event) => { event.preventDefault(); go(i); });
  screen.querySelectorAll(".choice").forEach((button, k) => button.addEventListener("click", () => guess(i, k)));
  const turn = tag("div", { class: "turn" });
  if (i) button(turn, "← Back", () => go(i - 1)); else turn.append(tag("span"));
  if (i + 1 < SCREENS.length) button(turn, "Next →", () => go(i + 1));
  screen.append(turn);
  return link;
});
const SCORE = tag("output", { "aria-live": "polite" });
const AGAIN = tag("button", { type: "button" }, "Start again");
AGAIN.addEventListener("click", () => {
  STATE.guesses = SCREENS.map(() => null);
  SCREENS.forEach((screen) => { screen.querySelector(".reveal").open = false; });
  go(0);
});
NAV.append(...LINKS, SCORE, AGAIN);
document.body.classList.add("stepped");
document.addEventListener("keydown", (event) => {
  if (event.ctrlKey || event.altKey || event.metaKey || event.target.matches("input")) return;
  if (event.key === "ArrowRight") go(STATE.current + 1);
  else if (event.key === "ArrowLeft") go(STATE.current - 1);
  else if (/^[a-f]$/i.test(event.key)) guess(STATE.current, "abcdef".indexOf(event.key.toLowerCase()));
});
window.addEventListener("hashchange", () => { read(location.hash); show(); });
window.addEventListener("beforeprint", () => { document.querySelector(".teacher").open = true; });
read(location.hash);
STATE.guesses.forEach((guess, i) => { if (guess !== null) SCREENS[i].querySelector(".reveal").open = true; });
show();
