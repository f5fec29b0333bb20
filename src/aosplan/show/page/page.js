// The theme

const theme = element("theme");
const dark = window.matchMedia("(prefers-color-scheme: dark)");
const isDark = () => (document.documentElement.dataset.theme || (dark.matches ? "dark" : "light")) === "dark";
function themed() { theme.setAttribute("aria-pressed", String(isDark())); draw(); }
theme.hidden = false;
theme.addEventListener("click", () => { document.documentElement.dataset.theme = isDark() ? "light" : "dark"; themed(); });
dark.addEventListener("change", themed);
themed();

// The table of waypoints, in pages

const ROWS = 100;
let first = 0;

function cell(tag, content, scope) {
  const made = document.createElement(tag);
  if (scope) made.scope = scope;
  made.textContent = content;
  return made;
}

function tabulate(from) {
  first = Math.min(Math.max(from, 0), Math.floor((count - 1) / ROWS) * ROWS);
  const last = Math.min(first + ROWS, count) - 1;
  const names = ["index", ...Object.keys(columns)];
  const head = document.createElement("tr");
  head.append(...names.map((name) => cell("th", name, "col")));
  const rows = [];
  for (let index = first; index <= last; index += 1) {
    const it = waypoint(index);
    const row = document.createElement("tr");
    row.append(...names.map((name, k) => (k ? cell("td", String(it[name])) : cell("th", String(index), "row"))));
    rows.push(row);
  }
  const [header, body] = element("rows").children;
  header.replaceChildren(head);
  body.replaceChildren(...rows);
  element("page-place").textContent = `${first} to ${last} of ${count}`;
  element("page-back").disabled = first === 0;
  element("page-on").disabled = last === count - 1;
}

element("waypoints").addEventListener("toggle", (event) => { if (event.target.open) tabulate(first); });
element("page-back").addEventListener("click", () => tabulate(first - ROWS));
element("page-on").addEventListener("click", () => tabulate(first + ROWS));

// Copying and saving the request and the plan's document

const told = element("told");

async function copied(source) {
  const text = source.textContent;
  try {
    await navigator.clipboard.writeText(text);
    told.textContent = "Copied.";
  } catch {
    // If the browser refuses access to the clipboard, the text is selected instead.
    source.closest("details")?.setAttribute("open", "");
    getSelection().selectAllChildren(source);
    told.textContent = "Selected: copy it with Ctrl+C.";
  }
}

for (const button of document.querySelectorAll("button.copy")) {
  button.addEventListener("click", () => copied(element(button.dataset.of)));
}

/** The document that `aosplan plan --json` prints, including the waypoints. */
function saved() {
  return { ...plan, waypoints: Array.from({ length: count }, (_, index) => waypoint(index)) };
}

element("save").addEventListener("click", () => {
  const link = document.createElement("a");
  link.href = URL.createObjectURL(new Blob([JSON.stringify(saved())], { type: "application/json" }));
  link.download = "plan.json";
  link.click();
  setTimeout(() => URL.revokeObjectURL(link.href), 10000);
  told.textContent = "Saved. aosplan export plan.json writes a mission file from it.";
});
