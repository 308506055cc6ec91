/** The last thing the page had to say; read out, and shown until it has been read or the next one comes. */

import { useEffect } from "preact/hooks";

import { useApp } from "../app_state";
import { Icon } from "../ui/icon";

const SHOWN_MS = 7000;

export function NoticeBar() {
  const { review } = useApp();
  const notice = review.notice.value;

  useEffect(() => {
    // What went wrong stays until somebody has seen it.
    if (!notice || notice.tone === "bad") return undefined;
    const timer = setTimeout(() => {
      if (review.notice.peek() === notice) review.notice.value = null;
    }, SHOWN_MS);
    return () => clearTimeout(timer);
  }, [notice]);

  return (
    <div class="notices">
      <div role={notice?.tone === "bad" ? "alert" : "status"} aria-live="polite" class="notice-live">
        {notice && (
          <p class={`notice ${notice.tone}`}>
            <Icon name={notice.tone === "bad" ? "warning" : notice.tone === "good" ? "accept" : "info"} />
            <span>{notice.text}</span>
            {notice.actions.map(({ label, run }) => (
              <button
                key={label}
                type="button"
                onClick={() => {
                  review.notice.value = null;
                  run();
                }}
              >
                {label}
              </button>
            ))}
            <button
              type="button"
              class="plain"
              aria-label="Dismiss"
              onClick={() => {
                review.notice.value = null;
              }}
            >
              <Icon name="close" />
            </button>
          </p>
        )}
      </div>
    </div>
  );
}
