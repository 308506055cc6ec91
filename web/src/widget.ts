/** The notebook's widget (anywidget); see view/ for what it shows. */
export { PhotoView } from "./view/photo_view";

export default { render(): void {} };
