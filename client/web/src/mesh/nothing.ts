// In place of modules of Node that the decoder only asks for outside of a browser.
export default {};
