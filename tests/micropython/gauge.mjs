// Runs jobs, each in a fresh 32-bit MicroPython (the official WebAssembly build). A job is a list of snippets; after
// each one it reports its output, its exception if any, and the bytes live on the heap.
//
// Input, JSON on standard input:  {"build": path of micropython.mjs, "files": {path: base64}, "jobs": [[text]]}
// Output, JSON on standard output: [[{"output": text, "error": text or null, "live": bytes}, ...], ...]
//
// This build collects garbage only when control is back in JavaScript: a collection asked for in one call has
// happened when the next one starts. So each figure is read in a call of its own, after a call that collects.

import { readFileSync } from "node:fs";

const input = JSON.parse(readFileSync(0, "utf8"));
const { loadMicroPython } = await import(input.build);
const files = Object.entries(input.files).map(([path, content]) => [path, Buffer.from(content, "base64")]);

async function measure(snippets) {
  const encoder = new TextDecoder();
  let written = [];
  const board = await loadMicroPython({
    heapsize: 1024 * 1024,
    linebuffer: false,
    stdout: (bytes) => written.push(Buffer.from(bytes)),
    stderr: (bytes) => written.push(Buffer.from(bytes)),
  });

  function run(source) {
    written = [];
    let error = null;
    try {
      board.runPython(source);
    } catch (raised) {
      error = String(raised.message ?? raised);
    }
    return { output: encoder.decode(Buffer.concat(written)), error };
  }

  function live() {
    run("gc.collect()");
    return Number(run("print(gc.mem_alloc())").output);
  }

  for (const [path, content] of files) {
    const folders = path.split("/").slice(0, -1);
    let folder = "/lib";
    for (const name of ["", ...folders]) {
      folder = name ? `${folder}/${name}` : folder;
      if (!board.FS.analyzePath(folder).exists) board.FS.mkdir(folder);
    }
    board.FS.writeFile(`/lib/${path}`, content);
  }

  run("import gc");
  live(); // the first reading interns the names it uses
  return snippets.map((source) => ({ ...run(source), live: live() }));
}

const reports = [];
for (const snippets of input.jobs) reports.push(await measure(snippets));
process.stdout.write(JSON.stringify(reports));
