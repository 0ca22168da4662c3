import { build } from "esbuild";
import { cp, mkdir, rm } from "node:fs/promises";

const out = "dist";
await rm(out, { recursive: true, force: true });
await mkdir(`${out}/assets`, { recursive: true });
await build({
  entryPoints: ["src/main.ts"], outfile: `${out}/assets/page.js`, bundle: true, minify: true,
  format: "iife", target: "es2022", legalComments: "inline",
});
await cp("src/style.css", `${out}/assets/style.css`);
await cp("src/index.html", `${out}/index.html`);
