/** What a newcomer with an empty store sees. */

import { sentence } from "../api/client";
import { useApp } from "../app_state";
import { CannotAnnotate } from "../dialogs/upload_dialog";
import { Icon } from "../ui/icon";
import { UploadList, UploadPicker } from "./upload_list";

const STEPS = [
  "cadpose finds the objects of a photo, and for each the CAD model of your library that resembles it most.",
  "It turns that model as the object stands: azimuth, elevation, in-plane rotation and focal length.",
  "Here you look at each, set right what is wrong, and accept. Every decision is stored at once.",
];

export function StartScreen() {
  const app = useApp();
  const { review } = app;
  const session = review.session.value;
  const can = session?.actions.annotate ?? false;

  async function example(): Promise<void> {
    try {
      app.uploader.follow(await app.api.example());
    } catch (error) {
      review.say(sentence(error), "bad", [{ label: "Try again", run: () => void example() }]);
    }
  }

  return (
    <main class="start">
      <div class="start-card">
        <h2>Nothing to review yet</h2>
        <ol class="steps">
          {STEPS.map((step) => (
            <li key={step}>{step}</li>
          ))}
        </ol>
        {can ? (
          <>
            <UploadPicker />
            {session?.actions.example && (
              <p>
                No photo at hand?{" "}
                <button type="button" class="command" onClick={() => void example()}>
                  <Icon name="cube" />
                  <span>Try the example photo</span>
                </button>
              </p>
            )}
          </>
        ) : (
          <CannotAnnotate />
        )}
        <UploadList />
        <p class="hint">
          Photos that are annotated already come in from the command line:{" "}
          <code>cadpose annotate photos/ --store URL</code>.
        </p>
      </div>
    </main>
  );
}
