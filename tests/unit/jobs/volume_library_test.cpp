#include "server/jobs/library/volume_library.h"

#include <algorithm>
#include <array>
#include <atomic>
#include <filesystem>
#include <functional>
#include <stop_token>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include <gtest/gtest.h>

#include "tests/support/errors.h"
#include "tests/support/process.h"
#include "tests/unit/jobs/fixture.h"

namespace isomesh::jobs {
namespace {

using test::code_thrown_by;

class VolumeLibraryTest : public test::JobsFixture {
 protected:
  static constexpr std::array<std::uint32_t, 3> kDims = {2, 3, 4};

  static ImportOptions raw(const Geometry& geometry = {}) {
    return {
        .raw = RawDescription{
            .dims = kDims, .type = SampleType::kUint8, .geometry = geometry, .big_endian = false}};
  }

  std::pair<Volume, bool> add_bytes(const std::string& bytes, const Geometry& geometry = {}) {
    test::write_file(folder_ / "upload", bytes);
    return library_.add("", folder_ / "upload", raw(geometry));
  }

  static void erase(BlobEraser& eraser, const std::string& key,
                    const std::function<void()>& erase_record) {
    eraser.erase([&](const store::BlobsGoing& going) {
      going(std::span(&key, 1));
      erase_record();
    });
  }

  // Ends the next job with a mesh of these bytes.
  void finish_with(const std::string& text) {
    const auto lease = jobs_.claim("worker", std::chrono::hours(1));
    ASSERT_TRUE(lease);
    const auto writer = blobs_.begin("");
    writer->write(std::as_bytes(std::span(text)));
    const store::Blob blob = writer->commit();
    store::Outcome outcome;
    outcome.mesh.emplace();
    outcome.mesh->files[MeshFormat::kDrc] = {blob.bytes, blob.key, ""};
    ASSERT_TRUE(jobs_.finish(*lease, outcome));
    blobs_.mark_named(blob.key);
  }

  // Has the eraser erase a volume of bytes_ after what `meanwhile` does.
  void erase_after(const std::function<void(const Volume& volume)>& meanwhile) {
    const Volume volume = add_bytes(bytes_).first;
    BlobEraser eraser(blobs_, volumes_, data_.erasing());
    erase(eraser, volume.samples, [&] {
      volumes_.erase("", volume.id, {}, {});
      meanwhile(volume);
    });
    eraser.finish();
  }

  const std::string bytes_ = "abcdefghijklmnopqrstuvwx";
};

TEST_F(VolumeLibraryTest, OtherSamplesOrGeometryAreAnotherVolume) {
  const std::string id = add_bytes(bytes_).first.id;
  EXPECT_NE(add_bytes(std::string(bytes_.rbegin(), bytes_.rend())).first.id, id);
  Geometry geometry;
  geometry.spacing = {1, 1, 2};
  EXPECT_NE(add_bytes(bytes_, geometry).first.id, id);
  EXPECT_EQ(volumes_.list("", {}, 100, store::ListOrder::kOldestFirst).size(), 3U);
}

// The same samples with exchanged names, as a correction makes them.
TEST_F(VolumeLibraryTest, WhatAFileSaysIsOfItsVolumeAlone) {
  const auto add = [&](const std::string& first, const std::string& second) {
    test::write_file(folder_ / "upload",
                     "NRRD0004\ntype: uint8\ndimension: 3\nsizes: 2 2 2\nencoding: raw\nspace: "
                     "LPS\nspace directions: (1,0,0) (0,1,0) (0,0,1)\nSegment0_Name:=" +
                         first + "\nSegment0_LabelValue:=1\nSegment1_Name:=" + second +
                         "\nSegment1_LabelValue:=2\n\n" + std::string("\0\1\1\1\2\2\2\0", 8));
    return library_.add("", folder_ / "upload").first;
  };
  const Volume wrong = add("left", "right");
  const Volume right = add("right", "left");
  EXPECT_NE(wrong.id, right.id);
  EXPECT_EQ(wrong.samples, right.samples);
  EXPECT_EQ(blob_count(), 1U);
  EXPECT_EQ(right.labels.front().name, "right");
  EXPECT_EQ(volumes_.get("", right.id), right);
  EXPECT_EQ(volumes_.get("", wrong.id), wrong);
  EXPECT_EQ(add("left", "right"), wrong);
  library_.erase("", wrong.id);
  library_.finish_erasing();
  EXPECT_EQ(blob_count(), 1U);
  library_.erase("", right.id);
  library_.finish_erasing();
  EXPECT_EQ(blob_count(), 0U);
}

TEST_F(VolumeLibraryTest, ANameThatAPersonChoseIsTheVolumes) {
  test::write_file(folder_ / "upload", bytes_);
  const auto add = [&](const UploadName& name) {
    return library_.add("", folder_ / "upload", raw(), name).first;
  };
  const Volume of_file = add({"a.raw"});
  const Volume chosen = add({"left knee", true});
  EXPECT_EQ(of_file.name, "a.raw");
  EXPECT_EQ(chosen.name, "left knee");
  EXPECT_EQ(of_file.id, chosen.id);
  EXPECT_EQ(add({"b.raw"}), chosen);
}

TEST_F(VolumeLibraryTest, ACancelledUploadLeavesNothing) {
  std::stop_source cancel;
  std::vector<std::string> stored;
  const ImportControl control = {.cancelled = cancel.get_token(),
                                 .stored = [&](const std::string& id) { stored.push_back(id); }};
  test::write_file(folder_ / "upload", bytes_);
  const auto add = [&] { return library_.add_all("", folder_ / "upload", raw(), {}, {}, control); };
  const std::string id = add().front().volume->id;
  EXPECT_EQ(stored, (std::vector<std::string>{id}));
  test::write_file(folder_ / "upload", std::string(bytes_.rbegin(), bytes_.rend()));
  cancel.request_stop();
  EXPECT_EQ(code_thrown_by(add), ErrorCode::kCancelled);
  EXPECT_EQ(stored.size(), 1U);
  EXPECT_EQ(blob_count(), 1U);
}

TEST_F(VolumeLibraryTest, LeavesTheUploadToItsOwner) {
  add_bytes(bytes_);
  EXPECT_EQ(test::read_file(folder_ / "upload"), bytes_);
}

TEST_F(VolumeLibraryTest, SamplesStayUntilTheirLastOwnerGoes) {
  test::write_file(folder_ / "upload", bytes_);
  const std::string id = library_.add("one", folder_ / "upload", raw()).first.id;
  EXPECT_TRUE(library_.add("other", folder_ / "upload", raw()).second);
  EXPECT_EQ(blob_count(), 1U);
  library_.erase("one", id);
  library_.finish_erasing();
  EXPECT_EQ(blob_count(), 1U);
  EXPECT_TRUE(volumes_.contains("other", id));
  library_.erase("other", id);
  library_.finish_erasing();
  EXPECT_EQ(blob_count(), 0U);
}

// The answer would tell that another owner has the same samples.
TEST_F(VolumeLibraryTest, WhatAnotherHasNeedsAsMuchRoomAsWhatIsNew) {
  const Volume theirs = add_bytes(bytes_).first;
  jobs_.submit({"", parameters_of(theirs, 100), "", ""});  // so that it does not expire
  store::Retention full(jobs_, volumes_, blobs_, data_.scratch(),
                        {.max_bytes = volumes_.named_bytes()});
  VolumeLibrary library(data_, blobs_, volumes_, full, {}, imports());
  const auto add_as = [&](const std::string& owner, const std::string& bytes) {
    test::write_file(folder_ / "upload", bytes);
    return code_thrown_by([&] { library.add(owner, folder_ / "upload", raw()); });
  };
  const std::string others(bytes_.rbegin(), bytes_.rend());
  EXPECT_EQ(add_as("other", others), ErrorCode::kOutOfSpace);
  EXPECT_EQ(add_as("other", bytes_), ErrorCode::kOutOfSpace);
  EXPECT_EQ(add_as("", bytes_), std::nullopt);
}

TEST_F(VolumeLibraryTest, AnUploadMakesRoomAsDataOfItsOwner) {
  const auto add_as = [&](VolumeLibrary& library, const std::string& owner, char letter) {
    test::write_file(folder_ / "upload", std::string(bytes_.size(), letter));
    return library.add(owner, folder_ / "upload", raw()).first.id;
  };
  const std::string oldest = add_as(library_, "other", '1');
  add_as(library_, "other", '2');
  const std::string first = add_as(library_, "", '3');
  add_as(library_, "", '4');
  store::Retention full(jobs_, volumes_, blobs_, data_.scratch(),
                        {.max_bytes = blobs_.bytes(), .grace = std::chrono::hours(-1)});
  VolumeLibrary library(data_, blobs_, volumes_, full, {}, imports());
  add_as(library, "", '5');
  EXPECT_TRUE(volumes_.contains("other", oldest));
  EXPECT_FALSE(volumes_.contains("", first));
}

// As after a process that died between the response and the erasing, and a sweep since then: the
// files stay, and what no record names lies in quarantine.
TEST_F(VolumeLibraryTest, WhatADeadProcessWasToEraseIsErasedAfterTheNextStart) {
  const Volume erased = add_bytes(bytes_).first;
  const Volume kept = add_bytes(std::string(bytes_.rbegin(), bytes_.rend())).first;
  for (const Volume& volume : {erased, kept}) {
    test::write_file(data_.erasing() / volume.samples, "");
  }
  volumes_.erase("", erased.id, {}, {});
  std::filesystem::rename(blobs_.path_of(erased.samples), data_.quarantine() / erased.samples);
  BlobEraser next(blobs_, volumes_, data_.erasing());
  next.finish();
  EXPECT_EQ(blob_count(), 1U);
  EXPECT_TRUE(std::filesystem::exists(blobs_.path_of(kept.samples)));
  EXPECT_TRUE(std::filesystem::is_empty(data_.quarantine()));
  EXPECT_TRUE(std::filesystem::is_empty(data_.erasing()));
}

TEST_F(VolumeLibraryTest, ADeletionIsNotedUntilTheSamplesAreErased) {
  const Volume volume = add_bytes(bytes_).first;
  BlobEraser eraser(blobs_, volumes_, data_.erasing());
  erase(eraser, volume.samples, [] {});
  // An earlier erasure of the same samples, which found them named, leaves the mark alone.
  erase(eraser, volume.samples, [&] {
    eraser.finish();
    EXPECT_TRUE(std::filesystem::exists(data_.erasing() / volume.samples));
    EXPECT_EQ(blob_count(), 1U);
    volumes_.erase("", volume.id, {}, {});
  });
  eraser.finish();
  EXPECT_EQ(blob_count(), 0U);
  EXPECT_TRUE(std::filesystem::is_empty(data_.erasing()));
}

// Slow uploads to remote storage: adopt() waits until `go` is set or it is stopped.
class SlowBlobs : public store::FileBlobStore {
 public:
  using FileBlobStore::FileBlobStore;

  void adopt(const std::filesystem::path& file, const store::Blob& blob, const std::string& owner,
             const std::stop_token& stop) override {
    has_begun = true;
    EXPECT_TRUE(test::eventually([&] { return go || stop.stop_requested(); }));
    if (stop.stop_requested()) throw Error(ErrorCode::kCancelled, "cancelled");
    FileBlobStore::adopt(file, blob, owner, stop);
  }

  std::atomic<bool> has_begun = false;
  std::atomic<bool> go = false;
};

TEST_F(VolumeLibraryTest, ErasingDoesNotWaitForBytesThatAreBeingStored) {
  const Volume volume = add_bytes(bytes_).first;
  SlowBlobs slow(data_);
  VolumeLibrary library(data_, slow, volumes_, retention_, {}, imports());
  test::write_file(folder_ / "upload", std::string(bytes_.rbegin(), bytes_.rend()));
  std::jthread adding([&] { library.add("", folder_ / "upload", raw()); });
  ASSERT_TRUE(test::eventually([&] { return slow.has_begun.load(); }));
  std::atomic<bool> is_erased = false;
  const std::jthread erasing([&] {
    library.erase("", volume.id);
    library.finish_erasing();
    is_erased = true;
  });
  EXPECT_TRUE(test::eventually([&] { return is_erased.load(); }));
  EXPECT_EQ(blob_count(), 0U);
  slow.go = true;
  adding.join();
  EXPECT_EQ(blob_count(), 1U);
}

TEST_F(VolumeLibraryTest, StoringBytesCanBeStopped) {
  test::write_file(folder_ / "upload", bytes_);
  for (const bool is_end : {false, true}) {
    SlowBlobs slow(data_);
    VolumeLibrary library(data_, slow, volumes_, retention_, {}, imports());
    std::stop_source cancel;
    const std::jthread stopping([&] {
      EXPECT_TRUE(test::eventually([&] { return slow.has_begun.load(); }));
      is_end ? library.stop_imports() : static_cast<void>(cancel.request_stop());
    });
    const auto add = [&] {
      library.add("", folder_ / "upload", raw(), {}, {}, {.cancelled = cancel.get_token()});
    };
    EXPECT_EQ(code_thrown_by(add), is_end ? ErrorCode::kUnavailable : ErrorCode::kCancelled);
  }
  EXPECT_EQ(blob_count(), 0U);
  EXPECT_TRUE(volumes_.list("", {}, 1, store::ListOrder::kOldestFirst).empty());
}

// A remote store may complete a request although it was stopped.
TEST_F(VolumeLibraryTest, BytesThatAStoppedStoreHasNeverthelessAreErased) {
  class Late : public store::FileBlobStore {
   public:
    using FileBlobStore::FileBlobStore;
    void adopt(const std::filesystem::path& file, const store::Blob& blob, const std::string& owner,
               const std::stop_token& stop) override {
      FileBlobStore::adopt(file, blob, owner, stop);
      mark_named(blob.key);  // as if it had not been stored
      throw Error(ErrorCode::kCancelled, "cancelled");
    }
  };
  Late late(data_);
  VolumeLibrary library(data_, late, volumes_, retention_, {}, imports());
  test::write_file(folder_ / "upload", bytes_);
  EXPECT_EQ(code_thrown_by([&] { library.add("", folder_ / "upload", raw()); }),
            ErrorCode::kCancelled);
  library.finish_erasing();
  EXPECT_EQ(blob_count(), 0U);
}

// In a row they would hold up the end of the service for long if the database hangs.
TEST_F(VolumeLibraryTest, VolumesAreErasedConcurrently) {
  class Counting : public store::SqlVolumeStore {
   public:
    explicit Counting(store::Database& database) : SqlVolumeStore(database) {}
    void erase(const store::Viewer& /*viewer*/, const std::string& /*id*/, store::Made /*made*/,
               const store::BlobsGoing& /*going*/) override {
      ++begun_;
      EXPECT_TRUE(test::eventually([this] { return begun_ == 2; }));
    }

   private:
    std::atomic<int> begun_ = 0;
  };
  Counting volumes(database_);
  VolumeLibrary library(data_, blobs_, volumes, retention_, {}, imports());
  const std::jthread one([&] { library.erase("", "one"); });
  library.erase("", "two");
}

// Each takes a tenth of a second unless somebody waits for them, and seconds if the database hangs.
TEST_F(VolumeLibraryTest, TheEndLeavesErasingToTheNextStart) {
  const Volume volume = add_bytes(bytes_).first;
  constexpr int kMany = 200;
  {
    BlobEraser eraser(blobs_, volumes_, data_.erasing());
    for (int n = 0; n < kMany; ++n) erase(eraser, std::to_string(n), [] {});
    erase(eraser, volume.samples, [&] { volumes_.erase("", volume.id, {}, {}); });
  }
  EXPECT_EQ(blob_count(), 1U);
  EXPECT_TRUE(std::filesystem::exists(data_.erasing() / volume.samples));
  BlobEraser next(blobs_, volumes_, data_.erasing());
  next.finish();
  EXPECT_EQ(blob_count(), 0U);
  EXPECT_TRUE(std::filesystem::is_empty(data_.erasing()));
}

TEST_F(VolumeLibraryTest, WhoeverWaitsForErasingCanBeStopped) {
  class Hanging : public store::SqlVolumeStore {
   public:
    explicit Hanging(store::Database& database) : SqlVolumeStore(database) {}
    bool names(const std::string& /*key*/) const override {
      EXPECT_TRUE(test::eventually([this] { return go.load(); }));
      return true;
    }
    std::atomic<bool> go = false;
  };
  Hanging volumes(database_);
  BlobEraser eraser(blobs_, volumes, data_.erasing());
  const std::string key(64, 'a');
  erase(eraser, key, [] {});
  std::stop_source stop;
  stop.request_stop();
  eraser.finish(stop.get_token());
  EXPECT_TRUE(std::filesystem::exists(data_.erasing() / key));
  volumes.go = true;
}

TEST_F(VolumeLibraryTest, AnErasedJobTakesTheFilesThatNoOtherHas) {
  const Volume volume = add_bytes(bytes_).first;
  JobParameters parameters;
  parameters.volume = volume.id;
  const std::string first = jobs_.submit({"", parameters, "", ""}).job.id;
  EXPECT_FALSE(library_.erase_job(jobs_, "", first));
  finish_with("mesh");
  const std::string again = jobs_.submit({"", parameters, "", ""}).job.id;
  EXPECT_TRUE(library_.erase_job(jobs_, "", first));
  library_.finish_erasing();
  EXPECT_EQ(blob_count(), 2U);
  EXPECT_TRUE(library_.erase_job(jobs_, "", again));
  library_.finish_erasing();
  EXPECT_EQ(blob_count(), 1U);
  EXPECT_TRUE(std::filesystem::exists(blobs_.path_of(volume.samples)));
}

TEST_F(VolumeLibraryTest, AnErasedVolumeTakesItsSurfacesOnRequest) {
  const Volume volume = add_bytes(bytes_).first;
  JobParameters parameters;
  parameters.volume = volume.id;
  const std::string job = jobs_.submit({"", parameters, "", ""}).job.id;
  finish_with("mesh");
  library_.erase("", volume.id, store::Made::kErased);
  library_.finish_erasing();
  EXPECT_EQ(code_thrown_by([&] { jobs_.get("", job); }), ErrorCode::kNotFound);
  EXPECT_EQ(blob_count(), 0U);
  EXPECT_TRUE(std::filesystem::is_empty(data_.erasing()));
}

// Whoever erases does not wait for the disk, which takes long for what is large and no time for
// what another owner has.
TEST_F(VolumeLibraryTest, AVolumeIsErasedBeforeItsSamplesAre) {
  erase_after([this](const Volume&) { EXPECT_EQ(blob_count(), 1U); });
  EXPECT_EQ(blob_count(), 0U);
}

TEST_F(VolumeLibraryTest, SamplesThatCameAgainMeanwhileStay) {
  erase_after([this](const Volume& volume) { volumes_.add("other", volume); });
  EXPECT_EQ(blob_count(), 1U);
}

TEST_F(VolumeLibraryTest, SamplesThatAreStoredAgainStayBeforeTheyAreNamed) {
  erase_after([this](const Volume& volume) {
    const std::filesystem::path again = data_.scratch() / "again";
    std::filesystem::copy_file(blobs_.path_of(volume.samples), again);
    blobs_.adopt(again, store::digest_of(again), "", {});
  });
  EXPECT_EQ(blob_count(), 1U);
}

// Earlier versions stored volumes in the order of their files. The copy of such a volume has the
// axes of the patient, and so has the change that undoes the first one.
TEST_F(VolumeLibraryTest, AChangeOfAVolumeInTheOrderOfItsFileCanBeUndone) {
  const volume::AxisOrder file = {3, 1, -2};  // its index i increases towards the head
  Volume old = add_bytes(bytes_).first;
  old.geometry = volume::in_order(old.dims, old.geometry, file);
  old.dims = volume::in_order(old.dims, file);
  old.stored_axes.reset();
  old.id = std::string(64, 'a');
  const std::filesystem::path stored = data_.scratch() / "old";
  std::ranges::fill(volume::CanonicalWriter(stored, {old.dims, old.type, old.geometry}).samples(),
                    std::byte{7});
  const store::Blob blob = store::digest_of(stored);
  blobs_.adopt(stored, blob, "", {});
  old.samples = blob.key;
  volumes_.add("", old);
  blobs_.mark_named(blob.key);
  const auto orientation = [](const Volume& volume) {
    const auto note =
        std::ranges::find(volume.notes, std::string("orientation-changed"), &Note::code);
    return note == volume.notes.end() ? "" : note->detail;
  };
  const Volume flipped = library_.reorient("", old.id, {-1, 2, 3}).first;
  EXPECT_TRUE(orientation(flipped).ends_with("gives to x,y,-z.")) << orientation(flipped);
  const Volume back = library_.reorient("", flipped.id, {1, 2, -3}).first;
  EXPECT_EQ(orientation(back), "");
  EXPECT_EQ(back.dims, kDims);
}

TEST_F(VolumeLibraryTest, OfManyEqualUploadsOneIsNew) {
  test::write_file(folder_ / "upload", bytes_);
  std::atomic<int> added = 0;
  std::vector<std::jthread> threads;
  for (int thread = 0; thread < 8; ++thread) {
    threads.emplace_back([&] {
      if (library_.add("", folder_ / "upload", raw()).second) ++added;
    });
  }
  threads.clear();
  EXPECT_EQ(added, 1);
  EXPECT_EQ(blob_count(), 1U);
}

}  // namespace
}  // namespace isomesh::jobs
