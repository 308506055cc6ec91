/** The page as a whole. */

import { useEffect } from "preact/hooks";

import { useApp } from "./app_state";
import { Dialogs } from "./dialogs/dialogs";
import { DecisionBar } from "./panels/decision_bar";
import { DisplayBar } from "./panels/display_bar";
import { DropZone } from "./panels/drop_zone";
import { Header } from "./panels/header";
import { InfoPanel } from "./panels/info_panel";
import { NoticeBar } from "./panels/notice_bar";
import { PosePanel } from "./panels/pose_panel";
import { QueuePanel } from "./panels/queue_panel";
import { Stage } from "./panels/stage";
import { StartScreen } from "./panels/start_screen";
import { Strips } from "./panels/strips";
import { Tabs } from "./panels/tabs";

export function Page() {
  const app = useApp();
  const { review } = app;
  const theme = app.theme.value;

  useEffect(() => {
    if (theme === "auto") delete document.documentElement.dataset.theme;
    else document.documentElement.dataset.theme = theme;
  }, [theme]);

  if (review.failure.value) return <Failure />;
  if (!review.session.value || !review.queue.loaded) {
    return (
      <main class="start">
        <p role="status">Opening the store …</p>
      </main>
    );
  }
  const start = review.queue.empty && review.currentId.value === null;
  return (
    <>
      <Header />
      {start ? <StartScreen /> : <Workbench />}
      <NoticeBar />
      <Dialogs />
      <DropZone />
    </>
  );
}

function Workbench() {
  const { review } = useApp();
  return (
    <div class="workbench" data-tab={review.tab.value}>
      <QueuePanel />
      <main class="work">
        <DisplayBar />
        <Stage />
        <Strips />
        <DecisionBar />
      </main>
      <aside class="side" aria-label="Adjust and details">
        <PosePanel />
        <InfoPanel />
      </aside>
      <Tabs />
    </div>
  );
}

function Failure() {
  const { review } = useApp();
  return (
    <main class="start">
      <div class="start-card">
        <h1>The page cannot begin</h1>
        <p class="problem" role="alert">
          {review.failure.value}
        </p>
        <button type="button" class="command main" onClick={() => void review.begin(null)}>
          Try again
        </button>
      </div>
    </main>
  );
}
