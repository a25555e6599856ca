/** Additions to every table: aligned decimal points, and on a phone the name of its column in each cell. */
const NUMBER = /^[-−]?\d+/;
const FIGURE_SPACE = "\u2007"; // as wide as a digit
const MOST_ROWS = 400;

/** Return the figure spaces before each text of a column that put its decimal points below each other. */
export function pads(texts: string[]): string[] {
  const wide = texts.map((one) => NUMBER.exec(one)?.[0].length ?? 0);
  const most = wide.filter(Boolean).length > 1 ? Math.max(...wide) : 0;
  return wide.map((one) => (one && most > one ? FIGURE_SPACE.repeat(most - one) : ""));
}

const set = (cell: HTMLElement, name: string, value: string): void =>
  void ((cell.dataset[name] ?? "") !== value && (cell.dataset[name] = value));

function arrange(table: HTMLTableElement, isNarrow: boolean): void {
  const heads = [...(table.tHead?.rows[0]?.cells ?? [])].map((one) => one.textContent.trim());
  for (const body of table.tBodies) {
    const rows = [...body.rows].slice(0, MOST_ROWS).map((row) => [...row.cells]);
    if (isNarrow)
      for (const row of rows)
        row.forEach((cell, k) => void (cell.scope !== "row" && heads[k] && set(cell, "head", heads[k])));
    else if (!table.classList.contains("fields"))
      for (let k = 0; k < (rows[0]?.length ?? 0); k++) {
        const cells = rows.flatMap((row) => row[k] ?? []);
        pads(cells.map((cell) => cell.textContent.trimStart())).forEach(
          (pad, row) => void set(cells[row]!, "pad", pad),
        );
      }
  }
}

/** Arrange the tables of the page now and after each change. */
export function arrangeTables(): void {
  const narrow = matchMedia("(max-width: 40rem)");
  let waits = false;
  const all = () => {
    waits = false;
    for (const table of document.querySelectorAll<HTMLTableElement>("main table")) arrange(table, narrow.matches);
  };
  const soon = () => void (waits || ((waits = true), requestAnimationFrame(all)));
  new MutationObserver(soon).observe(document.body, { childList: true, subtree: true, characterData: true });
  narrow.addEventListener("change", soon);
}
