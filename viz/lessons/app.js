// The lesson: one screen at a time, a guess on each that asks, a score; all of it in the address, nothing stored.

const LESSON = JSON.parse(document.getElementById("data").textContent);
const SCREENS = [...document.querySelectorAll(".screen")]; // the introduction, the questions, the end
const ASKING = SCREENS.filter((screen) => screen.querySelector(".predict"));
const STATE = { current: 0, guesses: ASKING.map(() => null) };

/** The state as the address has it, #3;1-0--: the screen, 0 the introduction, and a guess or a dash for each question. */
const written = () => `#${STATE.current};${STATE.guesses.map((guess) => guess ?? "-").join("")}`;
function read(text) {
  const match = /^#(\d+)(?:;([-0-9]*))?$/.exec(text);
  if (!match) return;
  STATE.current = Math.min(+match[1], SCREENS.length - 1);
  STATE.guesses = ASKING.map((screen, i) => {
    const guess = (match[2] ?? "")[i];
    return guess !== undefined && guess !== "-" && +guess < screen.querySelectorAll(".choice").length ? +guess : null;
  });
}
function score() {
  const made = STATE.guesses.filter((guess) => guess !== null).length;
  return made ? `${STATE.guesses.filter((guess, i) => guess === LESSON.answers[i]).length} of ${made} right` : "no guess yet";
}
function show() {
  SCREENS.forEach((screen, i) => {
    screen.classList.toggle("current", i === STATE.current);
    if (i === STATE.current) LINKS[i].setAttribute("aria-current", "step"); else LINKS[i].removeAttribute("aria-current");
  });
  ASKING.forEach((screen, i) => {
    const guess = STATE.guesses[i], answer = LESSON.answers[i];
    [...screen.querySelectorAll(".choice")].forEach((button, k) => {
      button.disabled = guess !== null;
      button.classList.toggle("chosen", guess === k);
      button.classList.toggle("right", guess !== null && k === answer);
      button.classList.toggle("wrong", guess === k && k !== answer);
    });
    screen.querySelector(".verdict").textContent =
      guess === null ? "" : guess === answer ? "Right. See why." : `Not so: ${"ABCDEF"[answer]}. See why.`;
    LINKS[SCREENS.indexOf(screen)].className = guess === null ? "" : guess === answer ? "right" : "wrong";
  });
  SCORE.textContent = score();
  document.querySelector("#end .score").textContent = `Your score: ${score()}; there ${ASKING.length === 1 ? "is one question" : `are ${ASKING.length} questions`}.`;
  play(ASKING.indexOf(SCREENS[STATE.current]));
  for (const each of SCREENS[STATE.current].querySelectorAll(".scroll, figure, .graph-picture"))
    if (each.scrollWidth > each.clientWidth) each.tabIndex = 0; // what scrolls is reached by keys
  try { history.replaceState(null, "", written()); } catch { /* a frame without an address */ }
}
function go(to) {
  STATE.current = Math.min(Math.max(to, 0), SCREENS.length - 1);
  show();
  window.scrollTo(0, 0);
}
function guess(question, choice) {
  if (question < 0 || STATE.guesses[question] !== null || choice >= ASKING[question].querySelectorAll(".choice").length) return;
  STATE.guesses[question] = choice;
  ASKING[question].querySelector(".reveal").open = true;
  show();
}
/** What there is to play with, made when its screen is first seen. */
function play(k) {
  const board = ASKING[k]?.querySelector(".board"), what = LESSON.plays[k];
  if (what?.kind && board && !board.hasChildNodes()) startPlay(board, { values: LESSON.values, ...what, ...MODULES[k] });
}
/** What a term means, below the paragraph that it stands in; pressed again, it goes. */
function explain(link) {
  const id = link.getAttribute("href").slice(1), block = link.closest("p, li, figure, table");
  const there = block.nextElementSibling?.dataset?.term === id ? block.nextElementSibling : null;
  link.setAttribute("aria-expanded", String(!there));
  if (there) there.remove();
  else block.after(tag("p", { class: "meaning", role: "note", "data-term": id },
    tag("b", {}, `${document.getElementById(id).textContent}: `), document.getElementById(id).nextElementSibling.textContent));
}

const LINKS = SCREENS.map((screen, i) => {
  const text = i === 0 ? "Start" : i === SCREENS.length - 1 ? "End" : String(i);
  const link = tag("a", { href: `#${i}`, "aria-label": `${text}: ${screen.querySelector("h2").textContent}` }, text);
  link.addEventListener("click", (event) => { event.preventDefault(); go(i); });
  const turn = tag("div", { class: "turn" });
  if (i) button(turn, "← Back", () => go(i - 1)); else turn.append(tag("span"));
  if (i + 1 < SCREENS.length) button(turn, "Next →", () => go(i + 1));
  screen.append(turn);
  return link;
});
ASKING.forEach((screen, i) =>
  screen.querySelectorAll(".choice").forEach((button, k) => button.addEventListener("click", () => guess(i, k))));
document.querySelectorAll("a.term").forEach((link) => {
  filled(link, { role: "button", "aria-expanded": "false" });
  link.addEventListener("click", (event) => { event.preventDefault(); explain(link); });
});
const SCORE = tag("output", { "aria-live": "polite" });
document.querySelector("nav").append(...LINKS, SCORE);
button(document.querySelector("nav"), "Start again", () => {
  STATE.guesses = ASKING.map(() => null);
  ASKING.forEach((screen) => { screen.querySelector(".reveal").open = false; });
  go(0);
});
document.body.classList.add("stepped");
document.addEventListener("keydown", (event) => {
  if (event.ctrlKey || event.altKey || event.metaKey || event.target.matches("input")) return;
  if (event.key === "ArrowRight") go(STATE.current + 1);
  else if (event.key === "ArrowLeft") go(STATE.current - 1);
  else if (/^[a-f]$/i.test(event.key))
    guess(ASKING.indexOf(SCREENS[STATE.current]), "abcdef".indexOf(event.key.toLowerCase()));
});
window.addEventListener("hashchange", () => { read(location.hash); show(); });
window.addEventListener("beforeprint", () => { document.getElementById("glossary").open = true; });
read(location.hash);
STATE.guesses.forEach((guess, i) => { if (guess !== null) ASKING[i].querySelector(".reveal").open = true; });
show();
