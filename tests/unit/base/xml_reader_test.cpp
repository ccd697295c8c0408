// XML documents of strangers.
#include "base/xml_reader.h"

#include <stdexcept>
#include <string>

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace isomesh {
namespace {

using testing::HasSubstr;
using testing::ThrowsMessage;

// Writes down what it is told.
class Notes : public XmlHandler {
 public:
  void start_element(std::string_view name, const XmlAttributes& attributes) override {
    notes += "<" + std::string(name);
    attributes.for_each(
        [&](const char* key, const char* value) { notes += " " + std::string(key) + "=" + value; });
    notes += ">";
    if (attributes.find("bad")) throw std::logic_error("it is bad");
    if (attributes.find("last")) reader->stop();
    places += std::to_string(reader->begin()) + "-" + std::to_string(reader->end()) + " ";
  }
  void end_element(std::string_view name) override { notes += "</" + std::string(name) + ">"; }
  void text(std::string_view part) override { notes += part; }
  void encoding(std::string_view name) override { notes += "{" + std::string(name) + "}"; }

  XmlReader* reader = nullptr;
  std::string notes;
  std::string places;
};

// Reads the document in pieces of `piece` bytes.
Notes notes_of(std::string_view document, std::size_t piece) {
  Notes notes;
  XmlReader reader(notes);
  notes.reader = &reader;
  for (std::size_t begin = 0; begin < document.size(); begin += piece) {
    reader.read(document.substr(begin, piece), begin + piece >= document.size());
  }
  return notes;
}

constexpr std::string_view kDocument =
    "<?xml version=\"1.0\" encoding=\"UTF-8\"?><a><b k=\"1 &amp; 2\" l=\"\"/>t&#228;xt</a>";

TEST(XmlReader, DoesNotDependOnThePieces) {
  for (const std::size_t piece : {1U, 2U, 7U, 1000U}) {
    const Notes notes = notes_of(kDocument, piece);
    EXPECT_EQ(notes.notes, "{UTF-8}<a><b k=1 & 2 l=></b>t\u00e4xt</a>");
    EXPECT_EQ(notes.places, "38-41 41-64 ");
  }
}

TEST(XmlReader, SaysWhereADocumentIsBroken) {
  EXPECT_THAT([] { notes_of("<a>\n<b></a>", 3); }, ThrowsMessage<XmlError>(HasSubstr("line 2")));
  EXPECT_THAT([] { notes_of("<a>", 3); }, ThrowsMessage<XmlError>(HasSubstr("line 1")));
}

TEST(XmlReader, RefusesEntities) {
  static constexpr std::string_view kBomb =
      "<!DOCTYPE a [<!ENTITY x \"ha\"><!ENTITY y \"&x;&x;&x;&x;\">]><a>&y;</a>";
  EXPECT_THAT([] { notes_of(kBomb, 1000); }, ThrowsMessage<XmlError>(HasSubstr("entity")));
  EXPECT_EQ(notes_of("<!DOCTYPE a SYSTEM \"http://example.org/a.dtd\"><a/>", 1000).notes,
            "<a></a>");
}

TEST(XmlReader, PassesOnWhatAHandlerThrows) {
  EXPECT_THAT([] { notes_of("<a><b bad=\"\"/></a>", 1000); },
              ThrowsMessage<std::logic_error>("it is bad"));
}

TEST(XmlReader, ReadsNothingAfterAStop) {
  EXPECT_EQ(notes_of("<a><b last=\"\"/></a>&&& no XML", 1000).notes, "<a><b last=>");
}

}  // namespace
}  // namespace isomesh
