import { defineConfig } from "vite";

/** The widget of `pn.explore`: one module that a notebook loads, made of parts of the page. */
export default defineConfig({
  build: {
    outDir: "../python/pneudrive/web/built",
    emptyOutDir: false,
    target: "es2022",
    reportCompressedSize: false,
    rollupOptions: { output: { codeSplitting: false } },
    lib: { entry: "src/explore.tsx", formats: ["es"], fileName: () => "widget.js", cssFileName: "widget" },
  },
});
