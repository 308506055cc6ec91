/** The dialogue that is open, if any. */

import { useApp } from "../app_state";
import { AuthorDialog } from "./author_dialog";
import { ConflictDialog } from "./conflict_dialog";
import { ExportDialog } from "./export_dialog";
import { HelpDialog } from "./help_dialog";
import { RejectDialog } from "./reject_dialog";
import { ReplaceDialog } from "./replace_dialog";
import { SearchDialog } from "./search_dialog";
import { StatsDialog } from "./stats_dialog";
import { UploadDialog } from "./upload_dialog";

export function Dialogs() {
  const { review } = useApp();
  const dialog = review.dialog.value;
  if (!dialog) return null;
  const onClose = (): void => {
    if (review.dialog.peek() === dialog) review.dialog.value = null;
  };
  switch (dialog.kind) {
    case "help":
      return <HelpDialog onClose={onClose} />;
    case "search":
      return <SearchDialog onClose={onClose} />;
    case "reject":
      return <RejectDialog onClose={onClose} />;
    case "stats":
      return <StatsDialog onClose={onClose} />;
    case "export":
      return <ExportDialog onClose={onClose} />;
    case "upload":
      return <UploadDialog onClose={onClose} />;
    case "replace":
      return <ReplaceDialog onClose={onClose} />;
    case "author":
      return <AuthorDialog then={dialog.then} onClose={onClose} />;
    case "conflict":
      return <ConflictDialog conflict={dialog.conflict} onClose={onClose} />;
  }
}
