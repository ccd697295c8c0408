// The part of Node's module `url` that a dependency of vtk.js (xmlbuilder2) takes.
export const domainToASCII = (domain) => new URL(`http://${domain}`).hostname;
export const domainToUnicode = domainToASCII;
