/** The whole page takes photos and folders that are dropped on it. */

import { useEffect, useState } from "preact/hooks";

import { sentence } from "../api/client";
import { useApp } from "../app_state";
import { droppedFiles } from "../state/folder";
import { Icon } from "../ui/icon";

export function DropZone() {
  const app = useApp();
  const { review } = app;
  const [over, setOver] = useState(false);

  useEffect(() => {
    const hasFiles = (event: DragEvent): boolean => event.dataTransfer?.types.includes("Files") ?? false;
    let leaving = 0;

    function onOver(event: DragEvent): void {
      if (!hasFiles(event)) return;
      event.preventDefault();
      clearTimeout(leaving);
      setOver(true);
    }
    function onLeave(): void {
      // Going from one element to the next leaves as well.
      leaving = window.setTimeout(() => setOver(false), 80);
    }
    function onDrop(event: DragEvent): void {
      if (!hasFiles(event) || !event.dataTransfer) return;
      event.preventDefault();
      setOver(false);
      void take(event.dataTransfer);
    }
    async function take(transfer: DataTransfer): Promise<void> {
      try {
        const files = await droppedFiles(transfer);
        if (review.session.peek()?.actions.annotate === false || files.length > 0) show();
        if (review.session.peek()?.actions.annotate === false) return;
        if (files.length === 0) review.say("There was no photo in it.");
        app.uploader.add(files);
      } catch (error) {
        review.say(sentence(error), "bad");
      }
    }
    function show(): void {
      if (!review.queue.empty) review.dialog.value = { kind: "upload" };
    }

    window.addEventListener("dragover", onOver);
    window.addEventListener("dragleave", onLeave);
    window.addEventListener("drop", onDrop);
    return () => {
      clearTimeout(leaving);
      window.removeEventListener("dragover", onOver);
      window.removeEventListener("dragleave", onLeave);
      window.removeEventListener("drop", onDrop);
    };
  }, []);

  if (!over) return null;
  return (
    <div class="drop-zone" aria-hidden="true">
      <p>
        <Icon name="upload" /> Drop photos or folders to annotate them
      </p>
    </div>
  );
}
