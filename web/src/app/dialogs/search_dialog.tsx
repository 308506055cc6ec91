/** Another model from the whole library, seen from where the present one is. */

import { useApp } from "../app_state";
import { Dialog } from "../ui/dialog";
import { LibraryPicker } from "./library_picker";

export function SearchDialog({ onClose }: { onClose(): void }) {
  const { review } = useApp();
  const draft = review.draft.value;
  if (!draft) return null;
  return (
    <Dialog title="Choose a model" wide onClose={onClose}>
      <LibraryPicker
        category={review.detail.value?.detection.category ?? ""}
        rotation={draft.pose}
        chosen={draft.cad.id}
        onChoose={(cad) => {
          review.setCad(cad);
          review.say(`Model: ${cad.name}.`);
          onClose();
        }}
      />
    </Dialog>
  );
}
