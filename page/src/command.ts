/** A command with the file of one valve in place of what it said of that valve. */
export function withFile(command: string, valve: string, path: string): string {
  if (!valve) return path;
  const others = command.split("\n").filter((one) => one.trim() && !new RegExp(`^\\s*${valve}(\\.command)?\\s*:`).test(one));
  return [...others, `${valve}: ${path}`].join("\n");
}

/** A name as one word of a shell. */
export const word = (name: string): string => (/^[\w./-]+$/.test(name) ? name : `'${name.replaceAll("'", `'\\''`)}'`);
