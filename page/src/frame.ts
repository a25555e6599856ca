/** Frames of the server: length of the head (4 bytes, little-endian), a head of JSON, arrays on multiples of 8 bytes. */

export type Numbers = Float32Array | Float64Array;

export interface Frame<Head> {
  head: Head;
  arrays: Map<string, Numbers>;
}

/** The last one: about what the numbers lie, where they are sent in 32 bits. */
type Listed = [name: string, kind: "f4" | "f8", at: number, length: number, middle?: number];

/** Read a frame; the arrays are views of its bytes, but for those that lie about a number. */
export function unpack<Head>(bytes: ArrayBuffer): Frame<Head> {
  const start = 4 + new DataView(bytes).getUint32(0, true);
  const { arrays, ...head } = JSON.parse(new TextDecoder().decode(new Uint8Array(bytes, 4, start - 4))) as {
    arrays: Listed[];
  };
  const found = new Map<string, Numbers>();
  for (const [name, kind, at, length, middle] of arrays) {
    const own = kind === "f4" ? new Float32Array(bytes, start + at, length) : new Float64Array(bytes, start + at, length);
    found.set(name, middle === undefined ? own : about(own, middle));
  }
  return { head: head as Head, arrays: found };
}

function about(values: Numbers, middle: number): Float64Array {
  const out = new Float64Array(values.length);
  for (let i = 0; i < values.length; i++) out[i] = values[i]! + middle;
  return out;
}
