/** The notebook's widget (anywidget); see view/ for what it shows. */
export default { render(): void {} };
