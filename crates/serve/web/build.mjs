// Bundles the page into dist/, or with --test bundles the unit tests and runs them.

import { spawnSync } from "node:child_process";
import { cpSync, mkdirSync, readdirSync, readFileSync, rmSync, writeFileSync } from "node:fs";
import { build } from "esbuild";

const LIBRARIES = ["three", "uplot"];

async function page() {
  // The folder itself stays: cargo watches it.
  rmSync("dist/assets", { recursive: true, force: true });
  rmSync("dist/index.html", { force: true });
  mkdirSync("dist/assets", { recursive: true });
  await build({
    entryPoints: { app: "src/main.ts" },
    outdir: "dist/assets",
    bundle: true,
    minify: true,
    format: "esm",
    target: "es2022",
    legalComments: "none",
    logLevel: "warning",
  });
  const licences = LIBRARIES.map((name) => {
    const { version } = JSON.parse(readFileSync(`node_modules/${name}/package.json`, "utf8"));
    return `${name} ${version}\n\n${readFileSync(`node_modules/${name}/LICENSE`, "utf8")}`;
  });
  writeFileSync("dist/assets/licences.txt", licences.join("\n\n"));
  // Last: that it is there says that the page is whole.
  cpSync("src/index.html", "dist/index.html");
}

async function test() {
  const out = "node_modules/.tests";
  rmSync(out, { recursive: true, force: true });
  const tests = readdirSync("test").filter((name) => name.endsWith(".test.ts"));
  await build({
    entryPoints: tests.map((name) => `test/${name}`),
    outdir: out,
    outExtension: { ".js": ".mjs" },
    bundle: true,
    format: "esm",
    platform: "node",
    target: "node18",
    logLevel: "warning",
  });
  const files = tests.map((name) => `${out}/${name.replace(/\.ts$/, ".mjs")}`);
  process.exitCode = spawnSync(process.execPath, ["--test", ...files], { stdio: "inherit" }).status ?? 1;
}

await (process.argv.includes("--test") ? test() : page());
