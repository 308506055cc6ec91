/** Files of a drop, folders and what lies in them too. */

import { isPicture } from "./uploads";

export interface Dropped {
  name: string;
  blob: Blob;
}

const MOST = 5000;

/** Everything that was dropped; entries must be taken before the drop event is over, which this does first. */
export async function droppedFiles(transfer: DataTransfer): Promise<Dropped[]> {
  const entries: FileSystemEntry[] = [];
  const loose: File[] = [];
  for (const item of transfer.items) {
    if (item.kind !== "file") continue;
    const entry = item.webkitGetAsEntry();
    const file = entry ? null : item.getAsFile();
    if (entry) entries.push(entry);
    else if (file) loose.push(file);
  }
  const found: Dropped[] = loose.map((file) => ({ name: file.name, blob: file }));
  for (const entry of entries) await walk(entry, found, entry.isDirectory);
  return found;
}

async function walk(entry: FileSystemEntry, found: Dropped[], inFolder: boolean): Promise<void> {
  if (found.length >= MOST) return;
  if (entry.isFile) {
    const file = await new Promise<File>((resolve, reject) => (entry as FileSystemFileEntry).file(resolve, reject));
    // What lies beside the photos of a folder is left aside; a file dropped by itself is told about.
    if (!inFolder || (isPicture(file.name) && !file.name.startsWith("."))) found.push({ name: file.name, blob: file });
    return;
  }
  const reader = (entry as FileSystemDirectoryEntry).createReader();
  for (;;) {
    // A reader gives a hundred or so at a time, and none when it is done.
    const some = await new Promise<FileSystemEntry[]>((resolve, reject) => reader.readEntries(resolve, reject));
    if (some.length === 0) return;
    for (const each of some) await walk(each, found, true);
  }
}
