// The parts of the page's address behind #, between &, "name=text" each.

const linkParts = () => location.hash.slice(1).split("&").filter(Boolean);
/** What stands behind "name=", or undefined. */
const linkPart = (name) => linkParts().find((each) => each.startsWith(`${name}=`))?.slice(name.length + 1);
/** Have "name=text" in the address, or nothing of that name for null; the rest stays. */
const keepPart = (name, text) => keepParts({ [name]: text }, false);
/** The same for {name: text}; with `step` the browser's Back goes back over it. */
function keepParts(parts, step) {
  const rest = linkParts().filter((each) => !(each.split("=")[0] in parts));
  const kept = Object.entries(parts).filter(([, text]) => text !== null).map(([name, text]) => `${name}=${text}`);
  const hash = `#${[...kept, ...rest].join("&")}`;
  if (hash === location.hash || (hash === "#" && !location.hash)) return;
  try {
    history[step ? "pushState" : "replaceState"](null, "", hash);
  } catch { /* a frame in a notebook has no address */ }
}
/** Copy the address, and tell whether that was possible. */
function copyLink(told) {
  if (!navigator.clipboard) { told(false); return; }
  navigator.clipboard.writeText(location.href).then(() => told(true), () => told(false));
}
/** The same, told by the button for a while. */
function copyByButton(button) {
  copyLink((copied) => { button.textContent = copied ? "copied" : "it is in the address"; setTimeout(() => { button.textContent = "copy link"; }, 1500); });
}
