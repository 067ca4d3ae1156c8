// The parts of the page's address behind #, between &, "name=text" each.

const linkParts = () => location.hash.slice(1).split("&").filter(Boolean);
/** What stands behind "name=", or undefined. */
const linkPart = (name) => linkParts().find((each) => each.startsWith(`${name}=`))?.slice(name.length + 1);
/** Have "name=text" in the address, or nothing of that name for null; the rest stays. */
function keepPart(name, text) {
  const rest = linkParts().filter((each) => !each.startsWith(`${name}=`));
  try {
    history.replaceState(null, "", `#${[...(text === null ? [] : [`${name}=${text}`]), ...rest].join("&")}`);
  } catch { /* a frame in a notebook has no address */ }
}
/** Copy the address, and tell whether that was possible. */
function copyLink(told) {
  if (!navigator.clipboard) { told(false); return; }
  navigator.clipboard.writeText(location.href).then(() => told(true), () => told(false));
}
