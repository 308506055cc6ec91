/** The way photos come in: a button, a place to drop them, and the list of those on their way. */

import { useRef } from "preact/hooks";

import { useApp } from "../app_state";
import { isPicture, type Upload } from "../state/uploads";
import { Icon } from "../ui/icon";

export function UploadPicker() {
  const app = useApp();
  const files = useRef<HTMLInputElement>(null);
  const folder = useRef<HTMLInputElement>(null);

  function take(input: HTMLInputElement, pictures: boolean): void {
    const chosen = [...(input.files ?? [])];
    const wanted = pictures ? chosen.filter((file) => isPicture(file.name)) : chosen;
    app.uploader.add(wanted.map((file) => ({ name: file.name, blob: file })));
    input.value = "";
  }

  return (
    <div class="upload-picker">
      <p>Drop photos or a folder anywhere on this page, or choose them:</p>
      <div class="buttons">
        <button type="button" class="command main" data-first onClick={() => files.current?.click()}>
          <Icon name="upload" />
          <span>Choose photos</span>
        </button>
        <button type="button" class="command" onClick={() => folder.current?.click()}>
          <Icon name="folder" />
          <span>Choose a folder</span>
        </button>
      </div>
      <input
        ref={files}
        type="file"
        hidden
        multiple
        accept="image/*"
        data-upload="files"
        aria-label="Photos"
        onChange={(event) => take(event.currentTarget, false)}
      />
      <input
        ref={(element) => {
          folder.current = element;
          element?.setAttribute("webkitdirectory", "");
        }}
        type="file"
        hidden
        multiple
        aria-label="Folder of photos"
        onChange={(event) => take(event.currentTarget, true)}
      />
    </div>
  );
}

export function UploadList() {
  const app = useApp();
  const uploads = app.uploads.value;
  if (uploads.length === 0) return null;
  const done = uploads.filter((each) => each.state === "done").length;
  const failed = uploads.filter((each) => each.state === "failed").length;
  return (
    <section class="uploads" aria-label="Photos on their way">
      <p role="status">
        {done} of {uploads.length} annotated{failed > 0 && `, ${failed} failed`}
      </p>
      <ul>
        {uploads.map((upload) => (
          <UploadRow key={upload.key} upload={upload} />
        ))}
      </ul>
      {done + failed > 0 && (
        <button type="button" onClick={() => app.uploader.clearFinished()}>
          Clear what is done
        </button>
      )}
    </section>
  );
}

function UploadRow({ upload }: { upload: Upload }) {
  const app = useApp();
  const first = upload.annotations[0];
  const moving = upload.state !== "done" && upload.state !== "failed";
  return (
    <li class={`upload ${upload.state}`}>
      <span class="upload-name">{upload.name}</span>
      {moving && <progress max={1} value={upload.share} aria-label={upload.name} />}
      <span class="upload-state">{told(upload)}</span>
      {first !== undefined && (
        <button type="button" onClick={() => app.show(first)}>
          Show
        </button>
      )}
      {upload.state === "failed" && app.uploader.canRetry(upload.key) && (
        <button type="button" onClick={() => app.uploader.retry(upload.key)}>
          Try again
        </button>
      )}
    </li>
  );
}

function told(upload: Upload): string {
  switch (upload.state) {
    case "waiting":
      return "waiting";
    case "sending":
      return upload.stage || "sending";
    case "queued":
      return "in the queue";
    case "running":
      return upload.stage || "annotating";
    case "failed":
      return upload.error || "failed";
    case "done": {
      const count = upload.annotations.length;
      return count === 0 ? "nothing to annotate was found" : `${count} object${count > 1 ? "s" : ""}`;
    }
  }
}
