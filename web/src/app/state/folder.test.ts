import { expect, test } from "vitest";

import { droppedFiles } from "./folder";

function file(name: string): FileSystemEntry {
  return {
    name,
    isFile: true,
    isDirectory: false,
    file: (take: (file: File) => void) => take(new File(["x"], name)),
  } as unknown as FileSystemEntry;
}

/** A folder whose reader gives two entries at a time, as browsers give a hundred. */
function folder(name: string, entries: FileSystemEntry[]): FileSystemEntry {
  return {
    name,
    isFile: false,
    isDirectory: true,
    createReader: () => {
      let at = 0;
      return { readEntries: (take: (some: FileSystemEntry[]) => void) => take(entries.slice(at, (at += 2))) };
    },
  } as unknown as FileSystemEntry;
}

function dropped(entries: FileSystemEntry[]): DataTransfer {
  const items = entries.map((entry) => ({ kind: "file", webkitGetAsEntry: () => entry }));
  return { items: [{ kind: "string" }, ...items] } as unknown as DataTransfer;
}

test("photos of a folder and of the folders in it, however many", async () => {
  const photos = ["a.jpg", "b.png", "c.webp", "d.JPEG", "e.tif"].map(file);
  const tree = folder("trip", [...photos, file("notes.txt"), file(".hidden.jpg"), folder("day", [file("f.bmp")])]);
  const found = await droppedFiles(dropped([tree]));
  expect(found.map((each) => each.name)).toEqual(["a.jpg", "b.png", "c.webp", "d.JPEG", "e.tif", "f.bmp"]);
});

test("a file that was dropped by itself is told about, whatever it is", async () => {
  expect((await droppedFiles(dropped([file("notes.txt")]))).map((each) => each.name)).toEqual(["notes.txt"]);
});
