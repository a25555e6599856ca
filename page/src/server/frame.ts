/**
 * Frames of the server: length of the head (4 bytes, little-endian), a head in JSON, arrays at multiples of 8
 * bytes.
 */

export type Numbers = Float32Array | Float64Array;

export interface Frame<Head> {
  head: Head;
  arrays: Map<string, Numbers>;
}

/** Entry of an array. Numbers sent in 32 bits are differences from `middle`. */
type Listed = [name: string, kind: "f4" | "f8", at: number, length: number, middle?: number];

/** Read a frame. The arrays are views of its bytes, except arrays with a `middle`. */
export function unpack<Head>(bytes: ArrayBuffer): Frame<Head> {
  const start = 4 + new DataView(bytes).getUint32(0, true);
  const { arrays, ...head } = JSON.parse(new TextDecoder().decode(new Uint8Array(bytes, 4, start - 4))) as {
    arrays: Listed[];
  };
  const found = new Map<string, Numbers>();
  for (const [name, kind, at, length, middle] of arrays) {
    const own =
      kind === "f4" ? new Float32Array(bytes, start + at, length) : new Float64Array(bytes, start + at, length);
    found.set(name, middle === undefined ? own : new Float64Array(own).map((value) => value + middle));
  }
  return { head: head as Head, arrays: found };
}
