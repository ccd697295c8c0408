#include "tests/unit/jobs/fixture.h"

namespace isomesh::test {

Volume JobsFixture::add_raw(const std::string& bytes, const RawDescription& description) {
  write_file(folder_ / "upload", bytes);
  return library_.add("", folder_ / "upload", {.raw = description}).first;
}

Volume JobsFixture::add_sphere() {
  return add(sample<float>(sphere({12.2, 11.7, 11.1}, 8.6), {25, 24, 23}), SampleType::kFloat32);
}

Volume JobsFixture::add_much() {
  return add(noise<std::uint8_t>({0, 100}, {72, 72, 72}, 5), SampleType::kUint8);
}

JobParameters JobsFixture::parameters_of(const Volume& volume, double iso) {
  JobParameters parameters;
  parameters.volume = volume.id;
  parameters.iso = iso;
  return parameters;
}

}  // namespace isomesh::test
