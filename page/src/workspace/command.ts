/** Return the command with one valve's entry replaced by a file. */
export function withFile(command: string, valve: string, path: string): string {
  if (!valve) return path;
  const others = command
    .split("\n")
    .filter((one) => one.trim() && !new RegExp(`^\\s*${valve}(\\.command)?\\s*:`).test(one));
  return [...others, `${valve}: ${path}`].join("\n");
}

/** Return a name quoted as one word of a shell. */
export const word = (name: string): string => (/^[\w./-]+$/.test(name) ? name : `'${name.replaceAll("'", `'\\''`)}'`);
