import { defineConfig } from "vite";

// One file with everything in it: a notebook loads the widget as text.
export default defineConfig({
  publicDir: false,
  build: {
    outDir: "../src/cadpose/review/static",
    emptyOutDir: false,
    target: "es2022",
    reportCompressedSize: false,
    chunkSizeWarningLimit: 1000,
    lib: { entry: "src/widget.ts", formats: ["es"], fileName: () => "widget.js" },
    // A library's spaces would stay otherwise.
    rolldownOptions: { output: { minify: true } },
  },
});
