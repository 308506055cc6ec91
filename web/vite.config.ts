import { defineConfig } from "vitest/config";

// Names without hashes: the built files are committed, and the server answers with an ETag. `three` has a file
// of its own, so that a change of the page does not rewrite it.
export default defineConfig({
  base: "/static/",
  build: {
    outDir: "../src/cadpose/review/static",
    // The widget is built beside it.
    emptyOutDir: false,
    target: "es2022",
    cssTarget: ["chrome123", "firefox120", "safari17.5"],
    modulePreload: { polyfill: false },
    assetsInlineLimit: 0,
    cssCodeSplit: false,
    license: { fileName: "licenses.md" },
    reportCompressedSize: false,
    chunkSizeWarningLimit: 1000,
    rolldownOptions: {
      output: {
        entryFileNames: "app.js",
        chunkFileNames: "[name].js",
        assetFileNames: (asset) => (asset.names[0]?.endsWith(".css") ? "app.css" : "[name][extname]"),
        codeSplitting: { groups: [{ name: "three", test: /node_modules\/three\// }] },
      },
    },
  },
  test: { include: ["src/**/*.test.ts", "src/**/*.test.tsx"] },
});
