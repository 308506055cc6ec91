/** On narrow screens one panel at a time. */

import { useApp } from "../app_state";
import type { Tab } from "../review";
import { Icon, type IconName } from "../ui/icon";

const TABS: readonly { value: Tab; label: string; icon: IconName }[] = [
  { value: "queue", label: "Queue", icon: "list" },
  { value: "adjust", label: "Adjust", icon: "sliders" },
  { value: "models", label: "Models", icon: "cube" },
  { value: "info", label: "Details", icon: "info" },
];

export function Tabs() {
  const { review } = useApp();
  return (
    <nav class="tabs" aria-label="Panels">
      {TABS.map(({ value, label, icon }) => (
        <button
          key={value}
          type="button"
          aria-current={review.tab.value === value ? "true" : undefined}
          onClick={() => {
            review.tab.value = value;
          }}
        >
          <Icon name={icon} />
          <span>{label}</span>
        </button>
      ))}
    </nav>
  );
}
