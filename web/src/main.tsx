import { render } from "preact";

import "./app/page.css";
import { guardLeaving, itemOf, keepAddress } from "./app/address";
import { Api } from "./app/api/client";
import { Page } from "./app/app";
import { App, AppProvider } from "./app/app_state";
import { listen } from "./app/keyboard";
import { Settings } from "./app/state/settings";

function shelf(): Storage | null {
  try {
    return window.localStorage;
  } catch {
    return null;
  }
}

const root = document.getElementById("app");
if (root) {
  const app = new App(new Api(), new Settings(shelf()));
  const wanted = itemOf(location.hash);
  keepAddress(app);
  guardLeaving(app);
  listen(app, window);
  render(
    <AppProvider value={app}>
      <Page />
    </AppProvider>,
    root,
  );
  void app.review.begin(wanted);
}
