/** Photos to add, and how far each is. */

import { useApp } from "../app_state";
import { UploadList, UploadPicker } from "../panels/upload_list";
import { Dialog } from "../ui/dialog";

export function UploadDialog({ onClose }: { onClose(): void }) {
  const { review } = useApp();
  return (
    <Dialog title="Add photos" onClose={onClose}>
      {review.session.value?.actions.annotate === false ? <CannotAnnotate /> : <UploadPicker />}
      <UploadList />
    </Dialog>
  );
}

export function CannotAnnotate() {
  return (
    <div class="hint">
      <p>Photos can be annotated here once a CAD library is there. Import one and start the page with it:</p>
      <pre>
        cadpose library add sweethome3d{"\n"}cadpose review --store URL --library DIR
      </pre>
    </div>
  );
}
