import { createHash } from "node:crypto";
import { readdirSync, readFileSync } from "node:fs";
import { join } from "node:path";
import { defineConfig } from "vite";

/** SHA-256 of everything that the page is built from: page and server compare it, and an old tab asks for a reload. */
function build(): string {
  const hash = createHash("sha256");
  const here = (of: string) => readdirSync(join(import.meta.dirname, of), { withFileTypes: true });
  const folders = [
    "src",
    ...here("src")
      .filter((one) => one.isDirectory())
      .map((one) => `src/${one.name}`)
      .sort(),
    ".",
  ];
  for (const folder of folders)
    for (const entry of here(folder).sort((a, b) => (a.name < b.name ? -1 : 1)))
      if (entry.isFile() && /\.(tsx?|css|html|json)$/.test(entry.name))
        hash.update(readFileSync(join(import.meta.dirname, folder, entry.name)));
  return hash.digest("hex").slice(0, 16);
}

export default defineConfig({
  define: { __BUILD__: JSON.stringify(build()) },
  build: {
    outDir: "../python/pneudrive/web/built",
    emptyOutDir: true,
    target: "es2022",
    assetsInlineLimit: 0,
    modulePreload: { polyfill: false },
    reportCompressedSize: false,
  },
  plugins: [
    {
      name: "build-file",
      generateBundle() {
        this.emitFile({ type: "asset", fileName: "build.json", source: JSON.stringify({ build: build() }) });
      },
    },
  ],
  test: { include: ["tests/*.test.ts"], css: true },
} as Parameters<typeof defineConfig>[0]);
