// The line where a surface meets the slice that a viewport shows, drawn over the slice. The surface is cut in the patient's millimetres, so
// the outlines lie right only if the surface and the volume do.
import { Enums } from '@cornerstonejs/core';
import vtkPlane from '@kitware/vtk.js/Common/DataModel/Plane.js';
import vtkCutter from '@kitware/vtk.js/Filters/Core/Cutter.js';

// Draws the outlines of a vtkPolyData over a viewport now, and whenever that shows another slice or part.
export function outlinesOver(viewport, surface) {
  const { element } = viewport;
  const canvas = document.createElement('canvas');
  canvas.className = 'outlines';
  element.after(canvas);
  const plane = vtkPlane.newInstance();
  const cutter = vtkCutter.newInstance();
  cutter.setCutFunction(plane);
  cutter.setInputData(surface);
  const draw = () => {
    const { focalPoint, viewPlaneNormal } = viewport.getCamera();
    plane.setOrigin(focalPoint);
    plane.setNormal(viewPlaneNormal);
    cutter.modified();
    drawCut(viewport, canvas, cutter.getOutputData());
  };
  element.addEventListener(Enums.Events.CAMERA_MODIFIED, draw);
  draw();
}

function drawCut(viewport, canvas, cut) {
  const { clientWidth: width, clientHeight: height } = viewport.element;
  const density = window.devicePixelRatio;
  canvas.width = width * density;
  canvas.height = height * density;
  const context = canvas.getContext('2d');
  context.scale(density, density);
  context.strokeStyle = '#ffd400';
  const points = cut.getPoints().getData();
  const lines = cut.getLines().getData();
  const onCanvas = (at) => viewport.worldToCanvas([points[3 * at], points[3 * at + 1], points[3 * at + 2]]);
  context.beginPath();
  // Two points each, after their number.
  for (let at = 0; at < lines.length; at += lines[at] + 1) {
    context.moveTo(...onCanvas(lines[at + 1]));
    context.lineTo(...onCanvas(lines[at + 2]));
  }
  context.stroke();
}
