// Files that were cut, changed on their way or made to do harm.

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/support/step.h"
#include "tests/unit/import/archives.h"
#include "tests/unit/import/files.h"
#include "tests/unit/import/vti_writer.h"
#include "tests/unit/import/writers.h"

namespace isomesh::import::test {
namespace {

using testing::HasSubstr;

struct Kind {
  std::string name;
  std::string bytes;
  std::size_t compressed_from;  // the first byte that compression guards; npos: none
};

std::vector<Kind> kinds() {
  const std::string plain = nifti({}, kSmallSamples);
  const std::string gzip_nrrd = nrrd(with(small_nrrd(), "encoding", "gzip"), gzip(kSmallSamples));
  const std::string packed = zlib(kSmallSamples);
  const Lines sized = with(with(small_metaimage(), "CompressedData", "True"), "CompressedDataSize",
                           std::to_string(packed.size()));
  const Lines unsized = with(small_metaimage(), "CompressedData", "True");
  const std::string detached = metaimage(with(small_metaimage(), "ElementDataFile", "a.raw"), "");
  constexpr std::size_t kNone = std::string::npos;
  // gzip's own header holds a time and a system, which nothing guards.
  constexpr std::size_t kGzipHeader = 10;
  return {
      {"nifti", plain, kNone},
      {"nifti-2", nifti({.version = 2, .big_endian = true}, kSmallSamples), kNone},
      {"nifti.gz", gzip(plain), kGzipHeader},
      {"nrrd", nrrd(small_nrrd(), kSmallSamples), kNone},
      {"nrrd gzip", gzip_nrrd, gzip_nrrd.size() - gzip(kSmallSamples).size() + kGzipHeader},
      {"nrrd.gz", gzip(nrrd(small_nrrd(), kSmallSamples)), kGzipHeader},
      {"mha", metaimage(small_metaimage(), kSmallSamples), kNone},
      {"mha zlib", metaimage(sized, packed), metaimage(sized, "").size()},
      {"mha zlib without size", metaimage(unsized, packed), metaimage(unsized, "").size()},
      {"vti", vti({.form = VtiForm::kAppendedRaw}, kSmallSamples), kNone},
      {"vti zlib", vti({.form = VtiForm::kBinary, .compressed = true}, kSmallSamples), kNone},
      {"zip", zip({{"a.nii", plain}}), kNone},
      {"tar", tar({{"a.nii", plain}}), kNone},
      {"tar.gz", gzip(tar({{"a.mhd", detached}, {"a.raw", std::string(kSmallSamples)}})), kNone},
  };
}

TEST(Damage, EveryTruncationIsRefused) {
  for (const Kind& kind : kinds()) {
    ASSERT_EQ(import_bytes(kind.bytes).error, "") << kind.name;
    for (std::size_t size = 0; size < kind.bytes.size(); size += isomesh::test::kStep) {
      const Outcome outcome = import_bytes(std::string_view(kind.bytes).substr(0, size));
      ASSERT_FALSE(outcome.imported()) << kind.name << " cut to " << size;
      ASSERT_THAT(outcome.code,
                  testing::AnyOf(ErrorCode::kUnusableVolume, ErrorCode::kUnsupportedMedia))
          << kind.name << " cut to " << size << ": " << outcome.error;
    }
  }
}

// The last bits of a deflate stream fill up its last byte and mean nothing; all others count.
TEST(Damage, NoChangeOfCompressedBytesIsTakenForSamples) {
  for (const Kind& kind : kinds()) {
    std::size_t imported = 0;
    for (std::size_t at = kind.compressed_from; at < kind.bytes.size();
         at += isomesh::test::kStep) {
      for (const int flip : {0x01, 0x80, 0xff}) {
        std::string bytes = kind.bytes;
        bytes[at] = static_cast<char>(bytes[at] ^ flip);
        const Outcome outcome = import_bytes(bytes);
        if (!outcome.imported()) continue;
        ++imported;
        EXPECT_EQ(outcome.sample_bytes(), kSmallSamples) << kind.name << " changed at " << at;
      }
    }
    EXPECT_LE(imported, 1U) << kind.name;
  }
}

// Whatever a header is changed to: refused or imported, with an error of ours and never a crash.
TEST(Damage, NoChangeOfAHeaderDoesHarm) {
  for (const Kind& kind : kinds()) {
    // Archives are mostly zeros between their members.
    const std::size_t step = isomesh::test::kStep * (1 + kind.bytes.size() / 400);
    for (std::size_t at = 0; at < kind.bytes.size(); at += step) {
      for (const int flip : {0x01, 0x10, 0x80, 0xff}) {
        std::string bytes = kind.bytes;
        bytes[at] = static_cast<char>(bytes[at] ^ flip);
        const Outcome outcome = import_bytes(bytes);
        if (!outcome.imported()) {
          EXPECT_NE(outcome.code, ErrorCode::kInternal) << outcome.error;
          EXPECT_THAT(outcome.error, testing::Not(HasSubstr("isomesh-volume"))) << kind.name;
        }
      }
    }
  }
}

TEST(Damage, GarbageBehindCompressedDataIsRefused) {
  const std::string file = gzip(nifti({}, kSmallSamples));
  EXPECT_THAT(import_bytes(file + "garbage").error,
              HasSubstr("followed by data that is not part of it"));
  EXPECT_TRUE(import_bytes(file + std::string(512, '\0')).imported());
  EXPECT_FALSE(import_bytes(file + "\x1f").imported());
}

TEST(Damage, SeveralGzipMembersAreOneFile) {
  const std::string file = nifti({}, kSmallSamples);
  const Outcome outcome = import_bytes(gzip(file.substr(0, 360)) + gzip(file.substr(360)));
  EXPECT_EQ(outcome.sample_bytes(), kSmallSamples);
}

TEST(Damage, BombsAreStoppedByCounting) {
  const std::string zeros(std::size_t{40} << 20, '\0');
  EXPECT_THAT(import_bytes(gzip(nifti({}, zeros))).error, HasSubstr("unpacks to more"));
  EXPECT_THAT(import_bytes(gzip(nrrd(small_nrrd(), zeros)), {.max_sample_bytes = 1000}).error,
              HasSubstr("unpacks to more"));
  EXPECT_THAT(import_bytes(gzip(vti({}, kSmallSamples) + zeros)).error,
              HasSubstr("unpacks to more"));
  EXPECT_THAT(import_bytes(nrrd(with(small_nrrd(), "encoding", "gzip"), gzip(zeros))).error,
              HasSubstr("more than the 24 bytes of samples"));
  EXPECT_THAT(
      import_bytes(metaimage(with(small_metaimage(), "CompressedData", "True"), zlib(zeros))).error,
      HasSubstr("more than the 24 bytes of samples"));
}

TEST(Damage, ClaimsBeyondTheLimitsAreRefusedBeforeAnythingIsInflated) {
  const NiftiFields huge{.dim = {3, 32767, 32767, 32767, 1, 1, 1, 1}};
  EXPECT_EQ(import_bytes(gzip(nifti(huge, kSmallSamples))).code, ErrorCode::kTooLarge);
  const Lines lines = with(small_nrrd(), "sizes", "60000 60000 60000");
  EXPECT_EQ(import_bytes(nrrd(with(lines, "encoding", "gzip"), gzip("a"))).code,
            ErrorCode::kTooLarge);
  EXPECT_EQ(import_bytes(nrrd(with(lines, "encoding", "ascii"), "1 2 3")).code,
            ErrorCode::kTooLarge);
}

TEST(Damage, WhatIsNoVolumeIsUnsupported) {
  const std::string garbage(1024, '\x5a');
  for (const std::string& bytes : {std::string(), std::string("hello"), garbage, gzip(garbage)}) {
    EXPECT_EQ(import_bytes(bytes).code, ErrorCode::kUnsupportedMedia);
  }
}

TEST(Damage, InTheFirstCompressedBytesIsNotAnUnknownFormat) {
  const std::string whole = gzip(nifti({.dim = {3, 4, 3, 2, 1, 1, 1, 1}}, kSmallSamples));
  constexpr std::size_t kHeaderBytes = 10;  // of gzip
  std::string corrupt = whole;
  corrupt[kHeaderBytes] = '\x07';  // a block of a kind that does not exist
  EXPECT_THAT(import_bytes(corrupt).error, testing::HasSubstr("corrupt"));
  EXPECT_EQ(import_bytes(corrupt).code, ErrorCode::kUnusableVolume);
  const std::string cut = whole.substr(0, kHeaderBytes + 2);
  EXPECT_THAT(import_bytes(cut).error, testing::HasSubstr("truncated"));
  EXPECT_EQ(import_bytes(cut).code, ErrorCode::kUnusableVolume);
}

}  // namespace
}  // namespace isomesh::import::test
