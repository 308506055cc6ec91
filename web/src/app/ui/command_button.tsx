/** A button that does what a key does, and tells the key. */

import type { ComponentChildren } from "preact";

import { useApp } from "../app_state";
import { command } from "../commands";
import { type ActionId, keyOf } from "../keys/bindings";
import { Icon, type IconName } from "./icon";

interface Props {
  id: ActionId;
  icon?: IconName;
  label: string;
  /** Without words in it; the label is its name all the same. */
  bare?: boolean;
  disabled?: boolean;
  pressed?: boolean;
  tone?: "good" | "bad" | "main";
  children?: ComponentChildren;
}

export function CommandButton({ id, icon, label, bare = false, disabled = false, pressed, tone, children }: Props) {
  const app = useApp();
  const key = keyOf(id);
  return (
    <button
      type="button"
      class={["command", tone, bare && "bare"].filter(Boolean).join(" ")}
      disabled={disabled}
      aria-pressed={pressed}
      aria-label={bare ? label : undefined}
      title={key ? `${label} (${key})` : label}
      onClick={() => command(app, id, 0)}
    >
      {icon && <Icon name={icon} />}
      {!bare && <span>{label}</span>}
      {children}
    </button>
  );
}
