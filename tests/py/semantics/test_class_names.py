"""Names of classes, and the classes that texts mean."""

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest

from gslts.semantics.class_names import ClassNames, Understood, read_class_names
from gslts.semantics.text_model import TextModel
from gslts.semantics.wordnet import FOLDER_VARIABLE, noun_synonyms, singular_forms

NAMES = ("cup", "sofa", "tvmonitor", "diningtable", "wine glass", "cell phone", "knife", "mouse")
SENSES = (
    (("sofa", "couch", "lounge"), "06"),
    (("knife",), "06"),
    (("dining_table", "board"), "06"),
    (("tv", "television"), "06"),
    (("stool",), "06"),
    (("fecal_matter", "stool"), "06"),
    (("cup", "stool"), "06"),
)
"""Meanings in the order of frequency: the third one of a stool is a cup here."""


@pytest.fixture
def wordnet(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Write files of WordNet, with the licence that the real ones have at their beginning."""
    folder = tmp_path / "wordnet"
    folder.mkdir()
    licence = "  1 This software and database is being provided to you, the LICENSEE  \n"
    data, offsets = licence, {}
    for words, lexicographer in SENSES:
        for word in words:
            offsets.setdefault(word, []).append(len(data))
        listed = " ".join(f"{word} 0" for word in words)
        data += f"{len(data):08d} {lexicographer} n {len(words):02x} {listed} 000 | a meaning  \n"
    lines = [
        f"{word} n {len(own)} 1 @ {len(own)} 0 {' '.join(f'{offset:08d}' for offset in own)}  \n"
        for word, own in sorted(offsets.items())
    ]
    (folder / "data.noun").write_text(data)
    (folder / "index.noun").write_text(licence + "".join(lines))
    (folder / "noun.exc").write_text("mice mouse\n")
    monkeypatch.setenv(FOLDER_VARIABLE, str(folder))
    return folder


@pytest.fixture
def no_wordnet(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv(FOLDER_VARIABLE, str(tmp_path / "nowhere"))


@pytest.mark.usefixtures("no_wordnet")
@pytest.mark.parametrize(
    ("text", "name"),
    [
        ("cup", "cup"),
        (" CUPS", "cup"),
        ("TV monitor", "tvmonitor"),
        ("dining-tables", "diningtable"),
        ("wine glasses", "wine glass"),
        ("cell_phone", "cell phone"),
        ("knives", "knife"),
        ("mice", "mouse"),
        ("couch", None),
        ("", None),
        ("🙂", None),
        ("s", None),
        ("CellPhones", "cell phone"),
    ],
)
def test_names_and_plurals_without_wordnet(text: str, name: str | None) -> None:
    found = ClassNames(NAMES).understand(text)
    assert (found and found.name) == name
    assert found is None or found.reason == "name"


@pytest.mark.usefixtures("wordnet")
@pytest.mark.parametrize(
    ("text", "name", "reason"),
    [
        ("couches", "sofa", "synonym"),
        ("board", "diningtable", "synonym"),
        ("mice", "mouse", "name"),
        ("phone", "cell phone", "kind"),
        ("monitors", "tvmonitor", "kind"),
        ("glass", "wine glass", "kind"),
    ],
)
def test_synonyms_irregular_plurals_and_kinds(text: str, name: str, reason: str) -> None:
    found = ClassNames(NAMES).understand(text)
    assert found is not None
    assert (found.name, found.reason) == (name, reason)


@pytest.mark.usefixtures("wordnet")
def test_rare_meanings_are_no_synonyms() -> None:
    assert noun_synonyms("stool") == ("stool", "fecal matter")
    assert ClassNames(NAMES).understand("stool") is None
    assert noun_synonyms("dining table") == ("dining table", "board")


@pytest.mark.usefixtures("wordnet")
def test_a_word_of_several_kinds_means_none() -> None:
    assert ClassNames(("cell phone", "desk phone")).understand("phone") is None


@pytest.mark.usefixtures("no_wordnet")
@pytest.mark.parametrize("name", ["cell_phone", "cell-phone", "Cell Phone"])
def test_kinds_are_those_of_names_with_any_separator(name: str) -> None:
    for text in ("phone", "phones"):
        assert ClassNames((name, "cup", "-")).understand(text) == Understood(name, "kind")


@pytest.mark.parametrize(
    ("file", "content", "named"),
    [
        ("index.noun", "couch n\n", "index.noun"),
        ("index.noun", "couch n x\n", "index.noun"),
        ("index.noun", "couch n 1 1 @ 1 0 first\n", "index.noun"),
        ("index.noun", "couch n 1 1 @ 1 0 00000001\n", "data.noun"),
        ("index.noun", "couch n 1 1 @ 1 0 99999999\n", "data.noun"),
        ("data.noun", "short", "data.noun"),
    ],
)
def test_damaged_files_of_wordnet_are_named(
    wordnet: Path, file: str, content: str, named: str
) -> None:
    (wordnet / file).write_text(content)
    with pytest.raises(ValueError, match=rf"^\S+/{named}: it is no file of WordNet"):
        ClassNames(NAMES).understand("couch")


@pytest.mark.usefixtures("no_wordnet")
def test_what_is_understood_is_explained() -> None:
    names = ClassNames(NAMES)
    assert names.explain("cups") == ""
    assert names.explain("phone") == '"phone": understood as cell phone (kind)'
    assert names.explain("mug") == (
        '"mug": none of the 8 classes of the detector; --text-model DIR may know more words'
    )


def test_singular_forms() -> None:
    assert "glass" in singular_forms("glasses")
    assert "wine glass" in singular_forms("wine glasses")
    assert "baby" in singular_forms("babies")
    assert singular_forms("cup") == []


class Texts:
    """Embeddings by hand: a mug is nearly a cup, and unrelated words are a little like a mouse."""

    def encode(self, texts: Sequence[str]) -> np.ndarray:
        rows = []
        for text in texts:
            row = np.zeros(len(NAMES) + 1)
            if text in NAMES:
                row[NAMES.index(text)] = 1
            elif text == "mug":
                row[0], row[-1] = 0.83, np.sqrt(1 - 0.83**2)
            elif text == "gadget":
                row[0], row[-1] = 0.3, np.sqrt(1 - 0.3**2)
            else:
                row[-2], row[-1] = 0.4, np.sqrt(1 - 0.4**2)
            rows.append(row)
        return np.array(rows, np.float32)


@pytest.mark.usefixtures("no_wordnet")
def test_a_text_model_understands_more_words_but_not_unrelated_ones() -> None:
    """The threshold, 0.4, is what unrelated words reach."""
    names = ClassNames(NAMES, Texts())
    assert names.explain("mug") == '"mug": understood as cup (0.83)'
    assert names.explain("gadget") == '"gadget": none of the 8 classes of the detector'
    assert names.understand("holiday") is None


def test_classes_can_be_left_out(tmp_path: Path) -> None:
    (tmp_path / "names").write_text("cup\n# person\nsofa\n\n")
    names, columns = read_class_names(tmp_path / "names")
    assert names == ("cup", "sofa")
    assert columns.tolist() == [0, -1, 1]


@pytest.mark.parametrize(
    ("content", "message"),
    [
        (b"", "it has no name"),
        (b"#cup\n", "it has no name"),
        (b"cup\n\nsofa\n", "line 2 is no name: ''"),
        (b"cup\nCups\x1b[31m\n", "line 2 is no name"),
        (b"cup\nsofa\nCup\n", "the name 'cup' occurs 2 times"),
        (b"x" * 101, "line 1 is no name"),
        (b"\xff\xfe\x00", "it is no text in UTF-8"),
        (b"".join(b"class %d\n" % k for k in range(1203)), "1203 classes are more than the 128"),
    ],
)
def test_bad_names_are_rejected(content: bytes, message: str, tmp_path: Path) -> None:
    (tmp_path / "names").write_bytes(content)
    with pytest.raises(ValueError, match=rf"names: {message}"):
        read_class_names(tmp_path / "names")


def write_text_model(folder: Path, *, inputs: int = 3, value: float = 1.0) -> None:
    """Write a model with an embedding of its own for each of three words."""
    from onnx import TensorProto, helper, numpy_helper, save_model
    from tokenizers import Tokenizer
    from tokenizers.models import WordLevel
    from tokenizers.pre_tokenizers import Whitespace

    folder.mkdir()
    tokenizer = Tokenizer(WordLevel({"[UNK]": 0, "cup": 1, "mug": 2}, unk_token="[UNK]"))
    tokenizer.pre_tokenizer = Whitespace()
    tokenizer.save(str(folder / "tokenizer.json"))
    names = ("input_ids", "attention_mask", "token_type_ids")[:inputs]
    table = np.array([[0, 0, 1], [1, 0, 0], [0.8, 0.6, 0]], np.float32) * value
    graph = helper.make_graph(
        [helper.make_node("Gather", ["table", "input_ids"], ["tokens"])],
        "texts",
        [helper.make_tensor_value_info(name, TensorProto.INT64, [1, "t"]) for name in names],
        [helper.make_tensor_value_info("tokens", TensorProto.FLOAT, [1, "t", 3])],
        [numpy_helper.from_array(table, "table")],
    )
    model = helper.make_model(graph, opset_imports=[helper.make_opsetid("", 12)])
    model.ir_version = 8
    save_model(model, folder / "model.onnx")


@pytest.mark.parametrize("inputs", [1, 3])
def test_text_models_are_means_of_tokens(inputs: int, tmp_path: Path) -> None:
    write_text_model(tmp_path / "model", inputs=inputs)
    found = TextModel(tmp_path / "model").encode(["cup", "mug", "mug cup", "xyz " * 5000])
    half = np.array([1.8, 0.6, 0]) / np.hypot(1.8, 0.6)
    np.testing.assert_allclose(found, [[1, 0, 0], [0.8, 0.6, 0], half, [0, 0, 1]], atol=1e-6)


def test_bad_text_models_are_rejected(tmp_path: Path) -> None:
    with pytest.raises(FileNotFoundError, match=r"expected model\.onnx and tokenizer\.json"):
        TextModel(tmp_path)
    write_text_model(tmp_path / "nan", value=np.nan)
    with pytest.raises(ValueError, match=r"model\.onnx: expected embeddings \[1,T,D\]"):
        TextModel(tmp_path / "nan").encode(["cup"])
    (tmp_path / "nan" / "tokenizer.json").write_text("{}")
    with pytest.raises(ValueError, match=r"tokenizer\.json: it is no tokenizer"):
        TextModel(tmp_path / "nan")
