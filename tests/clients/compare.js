// What a client shows of a box beside one picture of it as the server makes it. Pages set `window.show(name)`, which
// gives { width, height, pixels, box, crs }, and `window.names`.
'use strict';
const server = new URLSearchParams(location.search).get('server');
const centre = [11.05, 46.925];
// Web Mercator's metres of the centre, and of a pixel of the twelfth zoom of 256-sample tiles.
const EARTH = 6378137;
const mercator = [EARTH * centre[0] * Math.PI / 180, EARTH * Math.log(Math.tan(Math.PI / 4 + centre[1] * Math.PI / 360))];
const METRES = 38.21851414258813;
const mercatorBox = [mercator[0] - 128 * METRES, mercator[1] - 128 * METRES, mercator[0] + 128 * METRES, mercator[1] + 128 * METRES];

// Straight RGBA of what can be drawn on a canvas, at rectangles [x, y, width, height].
function pixelsOf(drawables, width, height) {
  const context = new OffscreenCanvas(width, height).getContext('2d');
  for (const [drawable, ...rectangle] of drawables) context.drawImage(drawable, ...rectangle);
  return context.getImageData(0, 0, width, height).data;
}

async function direct(crs, box, width, height) {
  const url = `${server}/wms?SERVICE=WMS&VERSION=1.3.0&REQUEST=GetMap&LAYERS=texture&STYLES=&CRS=${crs}&BBOX=${box}&WIDTH=${width}&HEIGHT=${height}&FORMAT=image/png`;
  return pixelsOf([[await createImageBitmap(await (await fetch(url)).blob()), 0, 0]], width, height);
}

// Mean difference of 255, and the contrast of what is shown.
window.compare = async name => {
  const shown = await window.show(name);
  if (shown.width !== 256 || shown.height !== 256) return { error: `${shown.width} x ${shown.height}` };
  const wanted = await direct(shown.crs, shown.box, 256, 256);
  let sum = 0, least = 255, greatest = 0;
  for (let i = 0; i < wanted.length; i++) {
    if (i % 4 === 3) continue;
    sum += Math.abs(shown.pixels[i] - wanted[i]);
    least = Math.min(least, shown.pixels[i]);
    greatest = Math.max(greatest, shown.pixels[i]);
  }
  return { difference: sum / (256 * 256 * 3), contrast: greatest - least };
};
