"""Household nouns, for objects that may come into a home after its map was made.

An autoencoder that was trained only on the objects of a map does not reconstruct others.
"""

NOUNS = tuple(
    """
    air conditioner, alarm clock, apple, armchair, baby bottle, backpack, bag, banana, basket,
    basketball, bathtub, bed, bench, bicycle, bin, blanket, blinds, book, bookshelf, boots, bottle,
    bowl, box, bread, broom, brush, bucket, cabinet, cable, cake, camera, candle, candlestick,
    cardboard box, carpet, cat, ceiling, ceiling lamp, chair, charger, clock, cloth, clothes, coat,
    coffee machine, coffee table, computer, computer monitor, cooking pot, counter top, credit card,
    crib, cup, cupboard, curtains, cushion, cutting board, desk, desk lamp, dining table,
    dishwasher, dog, dog bed, door, drawer, dresser, drying rack, dumbbell, egg, extension cord,
    fan, faucet, fireplace, fish tank, floor, floor lamp, flower, food, fork, frying pan, game
    console, garbage can, glass, glasses, guitar, hair dryer, hat, headphones, helmet, house plant,
    iron, ironing board, jacket, jar, kettle, key chain, keyboard, knife, ladder, lamp, laptop,
    laundry, laundry hamper, letter, lettuce, light switch, lunch box, magazine, medicine,
    microwave, mirror, mouse, mug, newspaper, orange, ottoman, oven, painting, pan, paper, paper
    towel roll, pen, pencil, pencil cup, pepper shaker, person, phone, photograph, piano, picture
    frame, pillow, plant, plate, poster, pot, potato, printer, radiator, radio, refrigerator, remote
    control, robot, rug, salt shaker, scale, scissors, sewing machine, shelf, shelving unit, shirt,
    shoes, shower, side table, sink, slippers, soap bottle, socks, sofa, speaker, sponge, spoon,
    stairs, statue, stool, stove, suitcase, table, tablet, tea pot, teddy bear, television, tissue
    box, toaster, toilet, toilet paper, tomato, toothbrush, towel, toy, toy car, trash bag, tray,
    trousers, tv stand, umbrella, vacuum cleaner, vase, violin, walker, wall, wallet, wardrobe,
    washing machine, watch, water bottle, wheelchair, window, wine bottle, yoga mat
    """.strip()
    .replace("\n    ", " ")
    .split(", ")
)
"""Nouns whose embeddings are added to the training set of the autoencoder."""
UNRELATED = tuple(
    """
    absence, advice, afternoon, agreement, algebra, ambition, anger, arrival, autumn, belief,
    century, charity, choir, climate, colony, committee, courage, crime, culture, damage, debt,
    decision, democracy, disease, distance, earthquake, economy, election, emotion, empire,
    evening, evidence, failure, famine, fever, freedom, friendship, galaxy, geography,
    government, gravity, happiness, harvest, history, holiday, honesty, hope, hunger, hurricane,
    idea, inflation, injury, interview, jealousy, journey, justice, kingdom, knowledge,
    language, law, lesson, luck, marriage, memory, midnight, minute, mountain, music, nation,
    ocean, opinion, patience, payment, peace, poetry, politics, poverty, prayer, promise, proof,
    religion, revolution, river, rumour, salary, science, silence, sorrow, speech, strategy,
    success, summer, tax, temperature, theory, thunder, tradition, treaty, truth, valley,
    victory, village, volcano, wedding, wisdom
    """.strip()
    .replace("\n    ", " ")
    .split(", ")
)
"""Nouns of what no room has, with whose scores thresholds of "not found" are calibrated."""
REJECTED_SHARE = 0.98
"""Share of unrelated words that must not match anything."""
