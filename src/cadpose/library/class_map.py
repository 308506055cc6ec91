"""COCO class names, ShapeNet synsets and Sweet Home 3D names to library categories.

``CATEGORIES`` is the one table; the functions look things up in it. COCO has no bag or table class: hand
bags, backpacks and suitcases are bags, a dining table is a table (as the paper's classes need).
"""

from __future__ import annotations

import re
from dataclasses import dataclass
from types import MappingProxyType

OTHER = "other"


@dataclass(frozen=True, slots=True)
class Category:
    """One library category.

    Attributes:
        name: As stored with a model.
        display: For people.
        synsets: WordNet 3.0 noun offsets, ShapeNetCore's own first; some categories have none there.
        coco: COCO-80 class names that mean it.
        paper: One of the paper's ten classes.
    """

    name: str
    display: str
    synsets: tuple[str, ...] = ()
    coco: tuple[str, ...] = ()
    paper: bool = False


def _c(name: str, synsets: str = "", coco: str = "", display: str = "", paper: bool = False) -> Category:
    names = tuple(c.strip() for c in coco.split(",") if c.strip())
    return Category(name, display or name.capitalize(), tuple(synsets.split()), names, paper)


_TABLE = (
    # The paper's ten classes.
    _c("bed", "02818832", "bed", paper=True),
    _c("motorbike", "03790512", "motorcycle", paper=True),
    _c("table", "04379243", "dining table", "Table or desk", paper=True),
    _c("oven", "04330267", "oven", "Oven or stove", paper=True),
    _c("bag", "02773838 02769748", "handbag, backpack, suitcase", paper=True),
    _c("clock", "03046257", "clock", paper=True),
    _c("bottle", "02876657", "bottle", paper=True),
    _c("chair", "03001627", "chair", "Chair or stool", paper=True),
    _c("car", "02958343", "car", paper=True),
    _c("bench", "02828884", "bench", paper=True),
    # Vehicles.
    _c("bus", "02924116", "bus"),
    _c("truck", "04490091", "truck"),
    _c("bicycle", "02834778", "bicycle"),
    _c("train", "04468005", "train"),
    _c("boat", "04530566 02858304", "boat"),
    _c("airplane", "02691156", "airplane"),
    _c("skateboard", "04225987", "skateboard"),
    # Furniture.
    _c("sofa", "04256520", "couch"),
    _c("cabinet", "02933112 03337140", display="Cabinet or wardrobe"),
    _c("bookcase", "02871439", display="Bookcase or shelf"),
    _c("lamp", "03636649"),
    _c("piano", "03928116"),
    # Kitchen and bath.
    _c("fridge", "04070727", "refrigerator", "Refrigerator"),
    _c("microwave", "03761084", "microwave"),
    _c("toaster", "04442312", "toaster"),
    _c("dishwasher", "03207941"),
    _c("washing machine", "04554684"),
    _c("sink", "04223580", "sink", "Sink or washbasin"),
    _c("toilet", "04446521", "toilet"),
    _c("bathtub", "02808440"),
    _c("faucet", "03325088"),
    _c("cup", "03797390 03147509", "cup", "Cup or mug"),
    _c("glass", "03438257", "wine glass", "Drinking glass"),
    _c("bowl", "02880940", "bowl"),
    _c("vase", "03593526", "vase", "Vase or jar"),
    _c("knife", "03624134", "knife"),
    _c("fork", "03383948", "fork"),
    _c("spoon", "04284002", "spoon"),
    _c("can", "02946921"),
    # Things with a plug.
    _c("tv", "03211117 04404412", "tv", "TV or monitor"),
    _c("laptop", "03642806", "laptop"),
    _c("keyboard", "03085013", "keyboard"),
    _c("mouse", "", "mouse", "Computer mouse"),
    _c("phone", "02992529", "cell phone", "Mobile phone"),
    _c("telephone", "04401088"),
    _c("remote", "04074963", "remote", "Remote control"),
    _c("camera", "02942699"),
    _c("printer", "04004475"),
    _c("speaker", "03691459"),
    _c("headphones", "03261776"),
    _c("microphone", "03759954"),
    _c("fan", "03320046"),
    _c("hair drier", "03483316", "hair drier"),
    # Other things.
    _c("plant", "03991062", "potted plant", "Potted plant"),
    _c("tree"),
    _c("umbrella", "04507155", "umbrella"),
    _c("book", "02870526", "book"),
    _c("guitar", "03467517"),
    _c("helmet", "03513137"),
    _c("cap", "02954340", display="Cap or hat"),
    _c("basket", "02801938"),
    _c("trash bin", "02747177"),
    _c("mailbox", "03710193"),
    _c("fire hydrant", "03346898", "fire hydrant"),
    _c("pillow", "03938244"),
    _c("pistol", "03948459"),
    _c("rifle", "04090263"),
    _c("rocket", "04099429"),
    _c("tower", "04460130"),
    _c("birdhouse", "02843684"),
    _c("ball", "02778669", "sports ball"),
    _c("tennis racket", "04409806", "tennis racket"),
    _c("scissors", "04148054", "scissors"),
    _c("teddy bear", "04399382", "teddy bear"),
    _c("watch", "04555897"),
    _c("radiator"),
    _c("fireplace"),
    _c("door"),
    _c("window"),
    # The living.
    _c("person", "", "person"),
    _c("dog", "", "dog"),
    _c("cat", "", "cat"),
    _c("horse", "", "horse"),
)

CATEGORIES: MappingProxyType[str, Category] = MappingProxyType({c.name: c for c in _TABLE})
PAPER_CATEGORIES = tuple(c.name for c in _TABLE if c.paper)

_FROM_COCO = {name: c.name for c in _TABLE for name in c.coco}
_FROM_SYNSET = {synset: c.name for c in _TABLE for synset in c.synsets}
# What people, file names and taxonomies call our categories.
_SYNONYMS = {
    "couch": "sofa", "settee": "sofa", "loveseat": "sofa", "armchair": "chair", "stool": "chair",
    "desk": "table", "coffee table": "table", "shelf": "bookcase", "bookshelf": "bookcase",
    "shelves": "bookcase", "wardrobe": "cabinet", "cupboard": "cabinet", "dresser": "cabinet",
    "nightstand": "cabinet", "chest of drawers": "cabinet", "file cabinet": "cabinet",
    "motorcycle": "motorbike", "scooter": "motorbike", "bike": "bicycle", "van": "car", "suv": "car",
    "refrigerator": "fridge", "stove": "oven", "mug": "cup", "handbag": "bag", "backpack": "bag",
    "suitcase": "bag", "monitor": "tv", "display": "tv", "television": "tv", "flowerpot": "plant",
    "pot": "plant", "washbasin": "sink", "bath": "bathtub", "cellphone": "phone",
    "cellular telephone": "phone",
    "loudspeaker": "speaker", "earphone": "headphones", "jar": "vase", "ashcan": "trash bin",
    "trashcan": "trash bin", "lorry": "truck", "plane": "airplane", "aeroplane": "airplane",
    "watercraft": "boat", "vessel": "boat", "wine glass": "glass",
}  # fmt: skip


def category_from_coco(name: str) -> str | None:
    """Library category of a COCO-80 class name, or None where no category fits."""
    return _FROM_COCO.get(name.strip().lower())


def category_from_synset(synset: str) -> str | None:
    """Library category of a WordNet offset such as ``"03001627"`` (also ``"n03001627"``), or None."""
    return _FROM_SYNSET.get(synset.strip().lower().removeprefix("n"))


def category_from_name(name: str) -> str | None:
    """Library category of what a person may write (``"Couches"``, ``"n03001627"``, ``"desk"``), or None."""
    key = re.sub(r"[\s_\-]+", " ", name.strip().lower())
    forms = [key]
    for ending, instead in (("ies", "y"), ("ves", "f"), ("es", ""), ("s", "")):
        if key.endswith(ending):
            forms.append(key[: -len(ending)] + instead)
    for form in forms:
        if form in CATEGORIES:
            return form
        if form in _SYNONYMS:
            return _SYNONYMS[form]
        if form in _FROM_COCO:
            return _FROM_COCO[form]
    return category_from_synset(key)


def category_or_word(name: str) -> str:
    """Library category of what a person may write; the word itself in lower case where there is none."""
    return category_from_name(name) or name.strip().lower()


@dataclass(frozen=True, slots=True)
class _Rule:
    pattern: re.Pattern[str]
    category: str
    where: re.Pattern[str] | None = None
    path: re.Pattern[str] | None = None

    def fits(self, name: str, where: str, path: str) -> bool:
        return (
            self.pattern.search(name) is not None
            and (self.where is None or self.where.search(where) is not None)
            and (self.path is None or self.path.search(path) is not None)
        )


def _r(pattern: str, category: str, where: str = "", path: str = "") -> _Rule:
    return _Rule(
        re.compile(rf"\b(?:{pattern})\b"),
        category,
        re.compile(where) if where else None,
        re.compile(path, re.IGNORECASE) if path else None,
    )


# The first rule that fits decides, so the narrow ones stand before the wide ones. Written against the names
# of Sweet Home 3D's own libraries and of Debian's package (820 models, every one looked at).
_RULES = (
    _r(".*", "dog", "characters", r"dog"),
    _r(".*", "cat", "characters", r"cat[^/]*$"),
    _r(".*", "horse", "characters", r"horse"),
    _r("chicken|rabbit|deer|bird|cow|pig", OTHER),
    _r(".*", "person", "characters"),
    # Named like something else.
    _r("table fan|ceiling fan|rigged fan|fan", "fan"),
    _r(
        "table tennis bat|rocking horse|clothes horse|car model|toy \\w+|\\w+ toy|dog house|cup ?cakes?",
        OTHER,
    ),
    _r("sleeping bag|punching bag|air mattress|abdominal bench|sofa table|clothes basket", OTHER),
    _r("curtain|blinds?|shutters?|carpet|rug|doormat|bathmat|tatami|mirror", OTHER),
    _r("wheel ?chair|chessboard|knife stand|bread box|bottle opener|cutlery|plates?|trays?", OTHER),
    _r("plugs?|sockets?|switch|dimmer|remote(?! control)|intercom|bell|parking slot|crossing", OTHER),
    _r("indoor bike|tricycle|stroller|shopping basket|towels?|paper|toilet brush|paper dispenser", OTHER),
    _r("glasses|sunglasses|lantern|candles?|flashlight", OTHER),
    _r("scooter", "motorbike", path=r"scooter2|katorlegaz"),
    _r("motorbikes?|motorcycles?|moped|yamaha|vespa", "motorbike", "vehicles"),
    _r("sandpit|swimming pool|diving board|child swing|seesaw|trampoline", OTHER),
    # Vehicles.
    _r("bus|coach", "bus", "vehicles"),
    _r("trucks?|lorry", "truck", "vehicles"),
    _r("bikes?|bicycles?", "bicycle"),
    _r("fork ?lift|tractor|scooter|skate ?park", OTHER),
    _r("skateboard", "skateboard"),
    _r("rowboat|boat|ship|canoe|kayak", "boat"),
    _r("biplane|airplane|aeroplane|plane", "airplane"),
    _r("train|tram|locomotive", "train", "vehicles"),
    _r(
        "cars?|van|suv|sedan|beetle|seat leon|peugeot|renault|chevrolet|ford|fiat|audi|bmw|citroen|toyota"
        "|volkswagen|vw|smart|mini|taxi|pick-?up|jeep|limousine|ambulance",
        "car",
        "vehicles",
    ),
    # Kitchen and bath, before the furniture that holds them.
    _r("microwave", "microwave"),
    _r("toaster", "toaster"),
    _r("dish ?washer", "dishwasher"),
    _r("washing machine|dryer machine|washer|tumble dryer", "washing machine"),
    _r("refrigerators?|fridges?|freezer", "fridge", path=r"^(?!.*chest).*$"),
    _r("stove", "oven", path=r"^(?!.*/stove/).*$"),
    _r("ovens?", "oven"),
    _r("sinks?( cabinet)?|wash ?basins?|basin|vanity|lavatory", "sink"),
    _r("toilets?( unit)?|toilets unit|wc", "toilet"),
    _r("bath|bathtub|bath ?tub", "bathtub"),
    _r("faucet|tap", "faucet"),
    # Seats and beds.
    _r("piano bench", "bench"),
    _r("opened convertible sofa.*|sofa bed opened", "bed"),
    _r("sofas?|couch|settee|loveseat|divan", "sofa"),
    _r("bedside tables?|night ?stands?", "cabinet"),
    _r("beds?|crib|cradle|cot|futon|mattress", "bed"),
    _r("little bank|wood bank", "bench"),
    _r("work ?bench", "table"),
    _r("bench(es)?", "bench"),
    _r("pool lounge|lounger|chaise longue", "chair"),
    _r("\\w*chairs?|stools?|class seat|armchair ottoman|rocking chair|seat", "chair"),
    _r("ottoman|pouff?e?|puff", OTHER),
    # Cabinets and shelves.
    _r("(tv|television) (stand|cabinet|unit)|tv furniture", "cabinet"),
    _r("chest freezer", OTHER),
    _r("changing table", "cabinet"),
    _r("wardrobes?|cupboards?|dressers?|chest|drawers?|cabinets?|closet|filing|lockers?|buffet", "cabinet"),
    _r("kitchen island|island|island extension", "cabinet", "kitchen"),
    _r("dresser with drawers|sideboard|commode|contemporary living room", "cabinet"),
    _r("bookcase", "cabinet", path=r"office_furniture1|dining_room"),
    _r("box", "cabinet", path=r"box_room|office_box"),
    _r("bookcases?|book ?shel(f|ves)|shel(f|ves)|utility shelving", "bookcase"),
    # Light.
    _r("lamps?|lights?|chandelier|lamp ?post|spotlight|fluorescent.*", "lamp"),
    # Tables.
    _r("desks?|tables?|table tennis|pool table", "table"),
    # Devices.
    _r("tv remote control|remote control", "remote"),
    _r("laptop|notebook computer|ibook|macbook", "laptop"),
    _r("tv|television|monitor|imac|wall flat tv", "tv"),
    _r("iphone|mobile phone|cell ?phone|smart ?phone", "phone"),
    _r("phone|telephone", "telephone"),
    _r("camera", "camera", path=r"^(?!.*surveillance).*$"),
    _r("printer", "printer"),
    _r("speakers?|loudspeakers?", "speaker"),
    _r("headphones?", "headphones"),
    _r("keyboard", "keyboard", "office"),
    _r("grand piano|upright piano|piano", "piano"),
    _r("guitar", "guitar"),
    _r("radiators?", "radiator"),
    _r("fire ?place", "fireplace"),
    # Small things.
    _r("bottles?|flacon", "bottle"),
    _r("cups?|mugs?", "cup"),
    _r("(beer|wine|cocktail) glass|glass", "glass", "kitchen"),
    _r("bowls?", "bowl"),
    _r("vases?|old jar|pottery|jar", "vase"),
    _r("kitchen knife|knife", "knife"),
    _r("fork", "fork"),
    _r("spoon", "spoon"),
    _r("hand ?bag|back ?pack|briefcase|suit ?case|bag|purse", "bag"),
    _r("watch", "watch"),
    _r("clocks?", "clock"),
    _r("book", "book"),
    _r("umbrella|parasol", "umbrella"),
    _r("scissors", "scissors"),
    _r("teddy bear", "teddy bear"),
    _r("basketball|soccer ball|football ball|tennis ball", "ball", path=r"^(?!.*(goal|net)).*$"),
    _r("tennis racket", "tennis racket"),
    _r("helmet", "helmet"),
    _r("caps?|hats?", "cap", "bedroom"),
    _r("mail ?box|letters? box", "mailbox"),
    _r("fire hydrant", "fire hydrant"),
    _r("trash ?cans?|trash can|dust ?bin|recycling bin|garbage.*|waste.*", "trash bin"),
    # Green things: in the house they stand in a pot, outside they grow.
    _r("flower box|plant box|planter", "plant"),
    _r("bonsai tree", "plant"),
    _r("(christmas|coconut|palm|bended coconut) tree|tree", "tree"),
    _r(
        "acacia|bamboo|ficus|pine|beech|cypress|maple|poplar|peach blossom|oak|birch|fir|willow",
        "tree",
        "exterior",
    ),
    _r(
        "plants?|cactus|orchids?|spathiphyllum|yucca|tulips?|white lily|lily|flowers?|ficus|bamboo|fern",
        "plant",
        "living|office|bedroom|miscellaneous|exterior|bathroom|kitchen",
    ),
    # Openings.
    _r("window|\\w+ window", "window", "doors"),
    _r("doors?|elevator", "door", "doors"),
)


def category_from_sweethome3d(catalogue_category: str, model_name: str, path: str) -> str:
    """Library category of a Sweet Home 3D piece, ``"other"`` where none fits.

    Args:
        catalogue_category: ``category#`` of the catalogue, in English: ``"Living room"`` ...
        model_name: ``name#`` in English: ``"Corner sofa"``.
        path: The model's path in the archive; decides where one name means several things.
    """
    name, where = model_name.lower(), catalogue_category.lower()
    for rule in _RULES:
        if rule.fits(name, where, path):
            return rule.category
    return OTHER
