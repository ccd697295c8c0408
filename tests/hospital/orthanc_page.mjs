// Presses the buttons of client/orthanc in Orthanc Explorer, and prints what the page says. PICTURE is written if it is given.
//
//   node orthanc_page.mjs URL SERIES [PICTURE]
import { createRequire } from 'node:module';

const { chromium } = createRequire(new URL('../../client/web/package.json', import.meta.url))('playwright-core');
const [url, series, picture] = process.argv.slice(2);
const browser = await chromium.launch({ executablePath: process.env.CHROMIUM, args: ['--no-sandbox', '--disable-gpu'] });
try {
  const page = await browser.newPage();
  const faults = [];
  page.on('pageerror', (error) => faults.push(String(error)));
  await page.goto(`${url}/app/explorer.html#series?uuid=${series}`);
  const lines = page.locator('#series .isomesh-line');
  await page.getByText('Mesh this series: bone').click();
  await lines.first().getByText('The mesh is in the study').waitFor();
  await page.getByText('Mesh this series: none').click();
  await lines.nth(1).getByText('rule').waitFor();
  if (picture) await page.locator('#series ul', { has: page.locator('#series-store') }).screenshot({ path: picture });
  const link = await lines.first().locator('a').getAttribute('href');
  const texts = await lines.allInnerTexts();
  // The lines are there again after another page.
  await page.locator('#series .study-link').click();
  await page.locator('#list-series a').filter({ hasText: 'Head bone' }).first().click();
  await lines.first().getByText('The mesh is in the study').waitFor();
  console.log(JSON.stringify({ texts, link, buttons: await page.locator('#series a', { hasText: 'Mesh this series' }).count(), faults }));
} finally {
  await browser.close();
}
