// What a dependency of vtk.js (xmlbuilder2) takes of Node's module `url`.
export const domainToASCII = (domain) => new URL(`http://${domain}`).hostname;
export const domainToUnicode = domainToASCII;
