// The stores of one daemon in a folder of the test, and volumes to put into them.
#pragma once

#include <filesystem>
#include <optional>
#include <string>

#include <gtest/gtest.h>

#include "server/jobs/library/volume_library.h"
#include "server/jobs/queue/job_process.h"
#include "server/jobs/queue/pipeline.h"
#include "server/store/files/blob_store.h"
#include "server/store/sql/volume_store.h"
#include "server/store/sqlite/database.h"
#include "server/store/sqlite/job_store.h"
#include "server/volume/canonical.h"
#include "tests/support/files.h"
#include "tests/support/shapes.h"

namespace isomesh::test {

class JobsFixture : public testing::Test {
 protected:
  // The records have the tables of these, too.
  explicit JobsFixture(const std::vector<store::Schema>& components = {})
      : database_(data_, components) {}

  // Adds samples as an upload of raw ones.
  template <class T>
  Volume add(const SampleVolume<T>& samples, SampleType type) {
    return add_raw(bytes_of(samples.samples),
                   {.dims = {samples.dims.x, samples.dims.y, samples.dims.z},
                    .type = type,
                    .geometry = samples.geometry,
                    .big_endian = false});
  }
  Volume add_raw(const std::string& bytes, const RawDescription& description);

  // A closed sphere of some thousand triangles.
  Volume add_sphere();
  // Noise whose surface is so large that smoothing it 1000 times takes many seconds.
  Volume add_much();

  // Options of the job queue with a short retry delay.
  static store::JobStoreOptions options() {
    store::JobStoreOptions result;
    result.retry_delay = std::chrono::milliseconds(5);
    return result;
  }

  // The real program of jobs, or another one in its place.
  jobs::JobProgram job_program(const std::filesystem::path& file = ISOMESH_JOB,
                               int threads = 2) const {
    return {.file = file, .setup = {.threads = threads}};
  }

  static JobParameters parameters_of(const Volume& volume, double iso);

  static jobs::RunnerOptions imports() {
    return {.bounds = {}, .at_once = 2, .program = ISOMESH_IMPORT};
  }

  std::size_t blob_count() const { return files_below(data_.blobs()).size(); }
  std::size_t scratch_count() const { return files_below(data_.scratch()).size(); }
  std::string blob(const std::string& key) const { return read_file(blobs_.path_of(key)); }

  TemporaryFolder folder_;
  store::DataFolder data_{folder_ / "data"};
  store::Database database_;
  store::FileBlobStore blobs_{data_};
  store::SqlVolumeStore volumes_{database_};
  store::SqliteJobStore jobs_{database_, blobs_, options()};
  store::Retention retention_{jobs_, volumes_, blobs_, data_.scratch(), store::RetentionOptions{}};
  jobs::VolumeLibrary library_{data_,    blobs_, volumes_, retention_, volume::SizeLimits{},
                               imports()};
};

// Jobs in a process of their own.
class PipelineFixture : public JobsFixture {
 protected:
  jobs::PipelineResult run(
      const Volume& volume, const JobParameters& parameters,
      const jobs::Report& report = [](Stage, double, const Timing&) {},
      const std::stop_token& stop = {}) {
    return run_pipeline(volume, parameters, {}, blobs_, process_, stop, report);
  }

  jobs::JobProcess process_{job_program()};
};

// Blobs of which one is cut right after it was found intact.
class CutBlobs : public store::FileBlobStore {
 public:
  explicit CutBlobs(const store::DataFolder& data) : FileBlobStore(data) {}

  bool is_intact(const std::string& key, const std::stop_token& stop) const override {
    const bool is = FileBlobStore::is_intact(key, stop);
    std::filesystem::resize_file(path_of(key), volume::kHeaderBytes);
    return is;
  }
};

}  // namespace isomesh::test

namespace isomesh::jobs {

// For those who do not look at the progress.
inline const Report kQuiet = [](Stage, double, const Timing&) {};

}  // namespace isomesh::jobs
