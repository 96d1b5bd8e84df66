// Elements of the page. Text is always text: nothing here takes markup.

type Attributes = Record<string, string | number | boolean | EventListener>;

/** An element with attributes, listeners (`onclick`) and children. */
export function element<K extends keyof HTMLElementTagNameMap>(
  tag: K,
  attributes: Attributes = {},
  ...children: (Node | string)[]
): HTMLElementTagNameMap[K] {
  const made = document.createElement(tag);
  for (const [name, value] of Object.entries(attributes)) {
    if (typeof value === "function") made.addEventListener(name.slice(2), value);
    else if (typeof value === "boolean") made.toggleAttribute(name, value);
    else made.setAttribute(name, String(value));
  }
  made.append(...children);
  return made;
}

/** An element that index.html has. */
export function byId(id: string): HTMLElement {
  const found = document.getElementById(id);
  if (!found) throw new Error(`index.html has no #${id}`);
  return found;
}

/** Changes a text only where it differs, so that a selection by the mouse survives. */
export function setText(node: Element, text: string): void {
  if (node.textContent !== text) node.textContent = text;
}

/** The items of a list, made anew only where they differ. */
export function setItems(list: Element, texts: readonly string[]): void {
  const shown = [...list.children].map((item) => item.textContent);
  if (shown.length === texts.length && texts.every((text, position) => text === shown[position])) return;
  list.replaceChildren(...texts.map((text) => element("li", {}, text)));
}

/** Puts children in this order without touching those that stand right. */
export function setChildren(parent: Element, children: readonly Element[]): void {
  for (const [position, child] of children.entries()) {
    if (parent.children[position] !== child) parent.insertBefore(child, parent.children[position] ?? null);
  }
  while (parent.children.length > children.length) parent.lastElementChild?.remove();
}
